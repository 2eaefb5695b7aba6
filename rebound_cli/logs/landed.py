"""EXTENDED_SYS_STATE from a .ulg, by PX4's rule (mavlink/streams/EXTENDED_SYS_STATE.hpp)."""

from collections.abc import Iterable

from companion.messages import ExtendedState, LandedState
from rebound_cli.logs.log import Heard
from rebound_cli.logs.topics import Topics

# position_setpoint.type
_TAKEOFF, _LAND = 3, 4


def landed_states(topics: Topics) -> Iterable[Heard]:
    """One at every change of what it is made of."""
    news = []
    for name, field in (
        ("vehicle_land_detected", "landed"),
        ("vehicle_control_mode", "flag_control_auto_enabled"),
        ("position_setpoint_triplet", "current.valid"),
        ("position_setpoint_triplet", "current.type"),
    ):
        topic = topics.get(name)
        values = None if topic is None else topic.column(field)
        if topic is not None and values is not None:
            news += [(time_us, field, int(value)) for time_us, value in zip(topic.time_us, values, strict=True)]
    known: dict[str, int] = {}
    for time_us, field, value in sorted(news, key=lambda item: int(item[0])):
        known[field] = value
        if "landed" in known:
            yield Heard(int(time_us), ExtendedState(_state(known)))


def _state(known: dict[str, int]) -> LandedState:
    if known["landed"]:
        return LandedState.ON_GROUND
    if known.get("flag_control_auto_enabled") and known.get("current.valid"):
        if known.get("current.type") == _TAKEOFF:
            return LandedState.TAKEOFF
        if known.get("current.type") == _LAND:
            return LandedState.LANDING
    return LandedState.IN_AIR
