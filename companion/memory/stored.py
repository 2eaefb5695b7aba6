"""Obstacle memory as people and files have it: the mission's `obstacles:` part and `obstacles.json`."""

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from companion.memory.patch import REACHES_M, Patch
from companion.reflex.surface import away_from
from companion.strict_model import NotNegative, PositionNed, Positive, StrictModel

# To a tenth of a millimetre, and without the exponents that YAML takes for text.
_DIGITS = 4


class KnownPatch(StrictModel):
    """A surface: where it was touched, and the direction out of it. NED from the arming position, metres."""

    touches_ned_m: Annotated[tuple[PositionNed, ...], Field(min_length=1)]
    """Places on the surface; of a wall two near its ends."""
    normal_ned: PositionNed
    """Of any length; a wall's counts as horizontal, see surface.away_from."""
    normal_error_deg: Annotated[NotNegative, Field(le=90.0)] = 15.0
    """One standard deviation; the normal of one whole contact."""
    reaches_m: NotNegative = REACHES_M
    """The least that it is assumed to extend beyond its touches."""
    found_at_us: Annotated[int, Field(strict=True, ge=0)] = 0
    """When it was first touched, by the clock of the flight that did."""

    @model_validator(mode="after")
    def _has_direction(self) -> Self:
        if not any(self.normal_ned):
            raise ValueError("normal_ned: has no direction; it points out of the surface, such as [-1, 0, 0]")
        return self

    def patch(self) -> Patch:
        return Patch(
            self.touches_ned_m,
            away_from(self.normal_ned),
            math.radians(self.normal_error_deg),
            self.reaches_m,
            self.found_at_us,
        )


class ObstacleFile(StrictModel):
    """The whole of an `obstacles.json`."""

    patches: tuple[KnownPatch, ...]
    """One for each surface."""


class ObstaclesConfig(StrictModel):
    """The mission's `obstacles:` part: what is known beforehand, and what follows where that leaves no way."""

    file: Annotated[str, Field(min_length=1)] | None = None
    """A file of them, such as the obstacles.json of an earlier run; beside the mission file, or an absolute path."""
    known: tuple[KnownPatch, ...] = ()
    """The same, written out here."""
    margin_m: Positive = 0.35
    """Between the guards and what is known. As recovery.clearance_m: guards 0.3 m clear, and 5 cm for the drift of
    a hover on optical flow."""
    on_unreachable: Literal["land", "return", "continue", "abort"] = "land"
    """continue: with the next item; abort: hand the vehicle over as `on_interrupt` says."""

    @model_validator(mode="after")
    def _is_read(self) -> Self:
        if self.file is not None:
            raise ValueError(f"file: {self.file} was not read; load the mission with rebound, or give `known`")
        return self

    def patches(self) -> tuple[Patch, ...]:
        return tuple(known.patch() for known in self.known)


def as_data(patch: Patch) -> dict[str, Any]:
    """A patch as files have it; `KnownPatch` reads it back."""
    return {
        "touches_ned_m": [_rounded(place) for place in patch.touches_ned_m],
        "normal_ned": _rounded(patch.normal_ned),
        "normal_error_deg": round(math.degrees(patch.normal_error_rad), 2),
        "reaches_m": round(patch.reaches_m, _DIGITS),
        "found_at_us": patch.found_at_us,
    }


def _rounded(vector: Sequence[float]) -> list[float]:
    # adding 0.0 turns a rounded -0.0 into 0.0
    return [round(component, _DIGITS) + 0.0 for component in vector]


def describe(patch: Patch) -> str:
    """For people: what, where, how much of it."""
    n, e, d = patch.centre_ned_m
    hits = "touched once" if patch.hits == 1 else f"touched {patch.hits} times"
    place = f"[{n:z.2f}, {e:z.2f}, {d:z.2f}]"
    north, east, down = patch.normal_ned
    if patch.is_steep:
        return f"surface {'above' if down > 0.0 else 'below'} at {place}, {hits}"
    facing_deg = round(math.degrees(math.atan2(east, north))) % 360
    low_m, high_m = patch.assumed_along_m()
    return f"surface facing {facing_deg} deg at {place}, {hits}, assumed {high_m - low_m:.1f} m wide"
