"""A mission's items, and the program that is flown: repeats written out, every step with its number and its policy."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Self

from pydantic import ConfigDict, Field, model_validator

from companion.mission.expectations import ExpectItem
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
from companion.mission.policy import OnCollision, OnTimeout
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


@dataclass(frozen=True, slots=True)
class Step:
    """`label` is the item's number as people count, "4.2 (2 of 3)" for the second lap of a repeat.

    `index` is the step's place in the whole program, for taking up an interrupted mission again.
    """

    index: int
    label: str
    item: MissionItem
    action: Action

    @property
    def name(self) -> str:
        return self.item.name


def program(items: tuple[MissionItem, ...]) -> tuple[Step, ...]:
    """All steps in the order in which they are flown. Raises ValueError when they are too many."""
    steps: list[Step] = []
    for label, item in _labelled(items, "", ""):
        steps.append(Step(len(steps), label, item, item.action))
        if len(steps) > MOST_STEPS:
            raise ValueError(f"items: more than {MOST_STEPS} steps once the repeats are written out")
    return tuple(steps)


def _labelled(items: tuple[MissionItem, ...], before: str, lap: str) -> Iterator[tuple[str, MissionItem]]:
    for number, item in enumerate(items, start=1):
        if item.repeat is None:
            yield f"{before}{number}{lap}", item
            continue
        for count in range(1, item.repeat.times + 1):
            yield from _labelled(item.repeat.items, f"{before}{number}.", f"{lap} ({count} of {item.repeat.times})")
