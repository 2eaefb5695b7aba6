"""The uploaded mission, geofence and rally points: one store a vehicle."""

from dataclasses import dataclass, field
from typing import TypeAlias

from sim_vehicle.autopilot.mission_protocol.mission_items import MissionType, StoredItem

# dataman.h and the SITL board's configuration.
MOST_ITEMS = {MissionType.MISSION: 10_000, MissionType.FENCE: 64, MissionType.RALLY: 32}


Plan: TypeAlias = tuple[StoredItem, ...]
"""One of the three lists."""


@dataclass(slots=True)
class Progress:
    """How far the mission is, as the navigator says."""

    reached: int = -1
    """The last item that was reached since the mission was begun or resumed; -1 for none."""
    valid: bool = False
    finished: bool = False
    is_flown: bool = False
    """The mode is MISSION, TAKEOFF or LAND."""

    def state(self, count: int, current: int) -> int:
        """MISSION_STATE of MISSION_CURRENT; 0 where PX4 keeps what it said before."""
        if count == 0 or not self.valid:
            return 1
        if self.finished:
            return 5
        if self.is_flown:
            return 3
        if self.reached >= 0:
            return 4
        return 2 if current < 1 else 0


@dataclass(slots=True)
class MissionStore:
    """What the links write and the navigator flies, and keeps within: nothing uses rally points."""

    plans: dict[int, Plan] = field(default_factory=dict)
    """By their types; those that were never stored are empty."""
    current: int = 0
    """The mission item that is flown, or will be."""
    uploading: bool = False
    """A link is receiving a list; no other may begin."""
    mission_changes: int = 0
    """Grows when the mission is another or somebody chose its current item; the navigator compares it."""
    fence_changes: int = 0
    progress: Progress = field(default_factory=Progress)

    @property
    def mission(self) -> Plan:
        return self.plan(MissionType.MISSION)

    def plan(self, kind: int) -> Plan:
        """The list of that type; an empty one for a type that does not exist."""
        return self.plans.get(kind, ())

    def replace(self, kind: int, plan: Plan, current: int | None = None) -> None:
        """Store a list in whole. ``current``: the item that its sender marked; None keeps the present one."""
        self.plans[kind] = plan
        if kind == MissionType.MISSION:
            last = max(len(plan) - 1, 0)
            self.current = min(max(self.current if current is None else current, 0), last)
            self.mission_changes += 1
        elif kind == MissionType.FENCE:
            self.fence_changes += 1

    def choose(self, number: int) -> None:
        """Make ``number`` the current item, if there is such an item."""
        if 0 <= number < len(self.mission) and number != self.current:
            self.current = number
            self.mission_changes += 1
