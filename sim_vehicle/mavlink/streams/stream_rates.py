"""For whom a link is, and how often it has a stream unasked.

Source: PX4's mavlink/mavlink_main.cpp (configure_streams_to_default) and init.d-posix/px4-rc.mavlink. Messages of
equipment that this vehicle does not have (gimbal, camera, transponder, speed controllers) are left out.
"""

from enum import Enum
from typing import NamedTuple

from sim_vehicle.errors import LinkAddressError

UNLIMITED = -1.0
"""Whenever there is something new."""


class LinkKind(Enum):
    """For whom a link is (PX4's MAVLINK_MODE)."""

    ONBOARD = "onboard"
    """A companion: UDP port 14540, or TELEM 2."""
    NORMAL = "normal"
    """A ground station behind a radio: TELEM 1."""
    GROUND = "ground"
    """A ground station of a simulation: UDP port 14550. Some streams are faster than a radio's (px4-rc.mavlink)."""


class Rates(NamedTuple):
    """In Hz, on each kind of link; None: not sent unasked."""

    onboard: float | None = None
    normal: float | None = None
    ground: float | None = None

    def on(self, link: LinkKind) -> float | None:
        """The rate on such a link."""
        rate_hz: float | None = getattr(self, link.value)
        return rate_hz


ON_REQUEST = Rates()


def link_kind(name: str) -> LinkKind:
    """By its name in addresses. Raises LinkAddressError for one that there is not."""
    try:
        return LinkKind(name)
    except ValueError as problem:
        names = ", ".join(kind.value for kind in LinkKind)
        raise LinkAddressError(f"unknown set of streams {name!r}: use one of {names}.") from problem
