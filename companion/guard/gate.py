"""Where all that is sent passes through the guard: its own setpoints go on, others' wait until it has given back."""

import math
from collections import deque
from collections.abc import Mapping
from typing import TypeAlias

# Whatever PX4 flies by in OFFBOARD (MavlinkReceiver's handlers).
SETPOINTS = frozenset(
    {
        "SET_POSITION_TARGET_LOCAL_NED",
        "SET_POSITION_TARGET_GLOBAL_INT",
        "SET_ATTITUDE_TARGET",
        "SET_ACTUATOR_CONTROL_TARGET",
    }
)
# Setpoints on their way at once; more than a few have been lost before they came by.
_MOST_ON_THE_WAY = 32

Mark: TypeAlias = tuple[object, ...]


class Gate:
    """Knows the guard's own setpoints again by what is in them, in the order in which they were sent."""

    def __init__(self) -> None:
        self._own: deque[Mark] = deque(maxlen=_MOST_ON_THE_WAY)
        self.kept_out = 0

    def sends(self, fields: Mapping[str, object]) -> None:
        """The guard is about to send this one."""
        self._own.append(_mark(fields))

    def is_own(self, fields: Mapping[str, object]) -> bool:
        """Whether a setpoint on its way is the guard's; asked once for each."""
        mark = _mark(fields)
        if mark not in self._own:
            return False
        while self._own.popleft() != mark:
            pass
        return True


def _mark(fields: Mapping[str, object]) -> Mark:
    """Time, mask and place, which may be NaN; two setpoints with the same of these are the same."""
    place = tuple(
        round(value, 3) if isinstance(value, float | int) and math.isfinite(value) else None
        for value in map(fields.get, "xyz")
    )
    return (fields.get("time_boot_ms"), fields.get("type_mask"), *place)
