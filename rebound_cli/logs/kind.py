"""What kind of vehicle a log is of: a multicopter, or the log is refused."""

import math
from collections.abc import Iterable
from pathlib import Path

from companion.link.vehicle import AUTOPILOT_COMPONENT_ID, MAV_AUTOPILOT_PX4, MULTICOPTERS, identify
from companion.messages import Heartbeat
from rebound_cli.logs.log import LogError
from rebound_cli.logs.topics import Topics

# MAV_TYPE_QUADROTOR, where a log names no type.
QUADROTOR = 2
# MAV_TYPE of a VTOL that does not say which, and of what vehicle_status.vehicle_type counts beside rotary wings.
_VTOL = 19
_OTHER_STATUS_TYPES = {2: 1, 3: 10}  # fixed wing, rover
# Of a quad-x every rotor is as far aside as ahead, of a plus one of them is zero; half-way between them are 22.5 deg.
_LEAST_DIAGONAL = math.tan(math.pi / 8)


def vehicle_type(path: Path, topics: Topics) -> int:
    """MAV_TYPE. Raises LogError where the vehicle is no multicopter."""
    said = [kind for kind in _said(topics) if kind]
    kind = next((kind for kind in said if kind not in MULTICOPTERS), said[0] if said else QUADROTOR)
    identity = identify(Heartbeat(1, AUTOPILOT_COMPONENT_ID, kind, MAV_AUTOPILOT_PX4, False, 0, 0))
    if isinstance(identity, str):
        raise LogError(f"{path}: {identity}; collisions are looked for in multicopters' logs alone.")
    return kind


def _said(topics: Topics) -> Iterable[int]:
    """0 says nothing. A parameter counts where the vehicle's own status holds no type."""
    status = topics.get("vehicle_status")
    kinds = None if status is None else status.column("system_type")
    yield int(topics.parameters.get("MAV_TYPE", 0) if kinds is None else kinds[-1])
    types = None if status is None else status.column("vehicle_type")
    yield 0 if types is None else _OTHER_STATUS_TYPES.get(int(types[-1]), 0)
    vtol = None if status is None else status.column("is_vtol")
    yield _VTOL if vtol is not None and vtol.all() else 0


def other_arms(name: str, rotors: Iterable[tuple[float, float]] = ()) -> str | None:
    """The vehicle in a word, where its arms are not those of a quad-x.

    `rotors`: metres ahead and aside of each, where they are known.
    """
    if name != "quadrotor":
        return name
    is_plus = any(min(abs(x), abs(y)) < _LEAST_DIAGONAL * max(abs(x), abs(y)) for x, y in rotors)
    return "quadrotor whose arms are no X" if is_plus else None


def rotors(topics: Topics) -> list[tuple[float, float]]:
    """As PX4's control allocation has them (v1.13 and later); empty where it does not say."""
    count = int(topics.parameters.get("CA_ROTOR_COUNT", 0))
    places = [[topics.parameters.get(f"CA_ROTOR{number}_P{axis}") for axis in "XY"] for number in range(count)]
    return [(x, y) for x, y in places if x is not None and y is not None]
