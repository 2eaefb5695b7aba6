"""The mission file as a model. Coordinates: NED, relative to the arming position, aligned north."""

import math
from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator

from companion.memory.stored import ObstaclesConfig
from companion.mission.config import CompanionConfig
from companion.mission.fence import Fence
from companion.mission.items import MissionItem
from companion.mission.itinerary import first_complaint
from companion.mission.policy import AbortWhen, Handover, Limits, OnCollision, Resume
from companion.recovery.interface import RecoveryConfig
from companion.recovery.registry import RECOVERY_LAWS, check_known_law
from companion.written import Written


class Mission(Written):
    """A whole mission file. `sim` belongs to the simulated vehicle and is ignored in a real flight."""

    name: Annotated[str, Field(min_length=1, pattern=r"^[A-Za-z0-9._-]+$")]
    """Letters, digits, dots, - and _; names the folder of the run."""
    description: str = ""
    """A line for people."""
    fence: Fence = Fence()
    limits: Limits = Limits()
    items: Annotated[tuple[MissionItem, ...], Field(min_length=2)]
    """Flown in order; take-off first, land or return last."""
    on_collision: OnCollision = OnCollision()
    """What follows a hit, where the item says nothing else."""
    recovery: RecoveryConfig = RecoveryConfig()
    obstacles: ObstaclesConfig = ObstaclesConfig()
    abort_when: AbortWhen = AbortWhen()
    on_interrupt: Handover = "hold"
    """What the vehicle is told to do when the flight ends early."""
    companion: CompanionConfig = CompanionConfig()
    resume: Resume | None = None
    sim: dict[str, object] | None = None

    @field_validator("recovery")
    @classmethod
    def _known_law(cls, recovery: RecoveryConfig) -> RecoveryConfig:
        check_known_law(recovery.law, RECOVERY_LAWS)
        return recovery

    @model_validator(mode="after")
    def _takeoff_first_land_last(self) -> Self:
        names = [item.name for item in self.items]
        if names[0] != "takeoff":
            raise ValueError(f"items: the first item must be takeoff, not {names[0]}")
        if names[-1] not in ("land", "return"):
            raise ValueError(f"items: the last item must be land or return, not {names[-1]}")
        for number, item in enumerate(self.items[1:-1], start=2):
            self._check_between(str(number), item)
        self._check_speed(str(len(names)), self.items[-1])
        return self

    def _check_between(self, number: str, item: MissionItem) -> None:
        if item.name in ("takeoff", "land", "return"):
            where = "first" if item.name == "takeoff" else "last"
            raise ValueError(f"items: item {number} is {item.name}, which may only come {where}")
        self._check_speed(number, item)
        for inner, below in enumerate(item.repeat.items if item.repeat else (), start=1):
            self._check_between(f"{number}.{inner}", below)

    def _check_speed(self, number: str, item: MissionItem) -> None:
        speed_m_s = 0.0
        if item.velocity is not None:
            speed_m_s = math.hypot(*item.velocity.velocity_ned_m_s)
        elif item.repeat is None:
            speed_m_s = getattr(item.action, "speed_m_s", None) or 0.0
        limit_m_s = self.limits.max_speed_m_s
        if speed_m_s > limit_m_s:
            flies = f"item {number} ({item.name}) flies at {speed_m_s:g} m/s"
            raise ValueError(f"items: {flies}, above limits.max_speed_m_s = {limit_m_s:g}")

    @model_validator(mode="after")
    def _ways_inside_fence(self) -> Self:
        complaint = first_complaint(self)
        if complaint is not None:
            raise ValueError(complaint)
        return self
