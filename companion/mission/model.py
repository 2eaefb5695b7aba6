"""The mission file as a model. Coordinates: NED, relative to the arming position, aligned north."""

import math
from typing import Annotated, Self

from pydantic import ConfigDict, Field, field_validator, model_validator

from companion.memory.stored import ObstaclesConfig
from companion.mission.config import CompanionConfig
from companion.mission.expectations import ExpectItem
from companion.mission.fence import Fence
from companion.mission.items import (
    Action,
    GoToItem,
    HoldItem,
    LandItem,
    OrbitItem,
    PathItem,
    ReturnItem,
    SetSpeedItem,
    SetYawItem,
    TakeoffItem,
    VelocityItem,
    WaitForItem,
)
from companion.mission.policy import AbortWhen, Handover, Limits, OnCollision, OnTimeout, Resume
from companion.recovery.interface import RecoveryConfig
from companion.recovery.registry import RECOVERY_LAWS, check_known_law
from companion.written import Positive, Written, with_bare_keys

# A mission longer than this once its repeats are written out is a slip of the pen.
MOST_STEPS = 10_000

ACTIONS = (
    *("takeoff", "go_to", "velocity", "path", "orbit", "hold", "wait_for"),
    *("set_speed", "set_yaw", "expect", "repeat", "return", "land"),
)


class RepeatItem(Written):
    """Fly the items one after the other, `times` times."""

    times: Annotated[int, Field(strict=True, ge=1, le=1000)]
    """How often in all."""
    items: Annotated[tuple["MissionItem", ...], Field(min_length=1)]
    """What is repeated."""


class MissionItem(Written):
    """One step: a map with exactly one action, and beside it what shall be different for this item."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [{"required": [name]} for name in ACTIONS],
            "dependentRequired": {"on_timeout": ["timeout_s"]},
        }
    )

    takeoff: TakeoffItem | None = None
    go_to: GoToItem | None = None
    velocity: VelocityItem | None = None
    path: PathItem | None = None
    orbit: OrbitItem | None = None
    hold: HoldItem | None = None
    wait_for: WaitForItem | None = None
    set_speed: SetSpeedItem | None = None
    set_yaw: SetYawItem | None = None
    expect: ExpectItem | None = None
    repeat: RepeatItem | None = None
    return_: Annotated[ReturnItem | None, Field(alias="return")] = None
    land: LandItem | None = None

    on_collision: OnCollision | None = None
    """What follows a hit in this item; without one the mission's policy."""
    timeout_s: Positive | None = None
    """How long the item may take, recoveries included."""
    on_timeout: OnTimeout = "abort"
    """What follows then; abort hands the vehicle over as on_interrupt says."""

    @model_validator(mode="before")
    @classmethod
    def _bare(cls, data: object) -> object:
        """`- land:` without braces reads as null in YAML and means the same."""
        return with_bare_keys(data, ("land", "return"))

    @model_validator(mode="after")
    def _exactly_one_action(self) -> Self:
        if len(self._actions_given()) != 1:
            raise ValueError(f"an item is a map with exactly one key of: {', '.join(ACTIONS)}")
        if self.on_timeout != "abort" and self.timeout_s is None:
            raise ValueError("on_timeout says what follows a time-out: give timeout_s too")
        if self.name in ("takeoff", "land", "return", "repeat") and self.timeout_s is not None:
            raise ValueError(f"timeout_s has no meaning beside {self.name}")
        if self.name in ("takeoff", "land", "repeat") and self.on_collision is not None:
            raise ValueError(f"on_collision has no meaning beside {self.name}")
        return self

    def _actions_given(self) -> list[str]:
        return [name for name in (field.removesuffix("_") for field in self.model_fields_set) if name in ACTIONS]

    @property
    def name(self) -> str:
        return self._actions_given()[0]

    @property
    def action(self) -> Action:
        """What is done; a repeat is no action of its own but what stands in it (see program)."""
        name = self.name
        action: Action | None = getattr(self, "return_" if name == "return" else name)
        assert action is not None and self.repeat is None, "the validator admits exactly one action"
        return action


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
        # Curves need scipy, whose import is slow: only missions that are otherwise sound pay for it.
        from companion.mission.itinerary import first_complaint

        complaint = first_complaint(self)
        if complaint is not None:
            raise ValueError(complaint)
        return self
