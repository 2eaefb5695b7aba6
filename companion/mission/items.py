"""What can stand in a mission's `items`, and the program that is flown: repeats written out, every step numbered.

Coordinates: NED, relative to the arming position.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import ConfigDict, Field, model_validator

from companion.autopilot.known import defaults
from companion.mission.policy import OnCollision
from companion.strict_model import NotNegative, Number, PositionNed, Positive, StrictModel

Count = Annotated[int, Field(strict=True, ge=0)]


class SomeKeys(StrictModel):
    """At least one key is given, of a choice exactly one."""

    is_choice: ClassVar[bool] = False

    @model_validator(mode="after")
    def _enough(self) -> Self:
        given = len(self.model_dump(exclude_none=True))
        if given == 0 or (self.is_choice and given > 1):
            number = "exactly" if self.is_choice else "at least"
            raise ValueError(f"give {number} one key: {', '.join(type(self).model_fields)}")
        return self


class ExpectHit(StrictModel):
    """From here on, a hit is detected within the time; with a speed before the contact within the bounds given."""

    within_s: Positive
    """From here on."""
    min_speed_m_s: NotNegative | None = None
    """Of the vehicle just before the hit."""
    max_speed_m_s: Positive | None = None
    """Of the vehicle just before the hit."""


class ExpectNoHit(StrictModel):
    """From here on no hit is detected, for the time or until the end of the flight."""

    for_s: Positive | None = None
    """Without it until the end of the flight."""


class ExpectHits(SomeKeys):
    """How many hits there have been until here."""

    exactly: Count | None = None
    """The number."""
    at_least: Count | None = None
    """The least number."""
    at_most: Count | None = None
    """The largest number."""


class ExpectRecovered(StrictModel):
    """Until here there was a hit, and the latest one has been recovered from."""

    within_s: Positive | None = None
    """Largest time from the hit until rest."""
    max_overshoot_m: Positive | None = None
    """Largest overshoot past the recovery setpoint."""


class ExpectPosition(StrictModel):
    """The vehicle is here now."""

    ned_m: PositionNed
    """North, east, down of the arming position."""
    within_m: Positive
    """Distance to it at most."""


class ExpectHeight(SomeKeys):
    """The vehicle's height above the arming position now."""

    min_m: NotNegative | None = None
    """At least."""
    max_m: Positive | None = None
    """At most."""


class ExpectFlightTime(StrictModel):
    """Time since arming, now."""

    at_most_s: Positive
    """Since arming."""


Check: TypeAlias = (
    ExpectHit | ExpectNoHit | ExpectHits | ExpectRecovered | ExpectPosition | ExpectHeight | ExpectFlightTime
)


class ExpectItem(SomeKeys):
    """A map with exactly one key. One that is not met makes the flight's outcome `failed`; the flight goes on."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})
    bare = frozenset({"no_collision", "recovered"})
    is_choice = True

    collision: ExpectHit | None = None
    no_collision: ExpectNoHit | None = None
    collisions: ExpectHits | None = None
    recovered: ExpectRecovered | None = None
    position: ExpectPosition | None = None
    height: ExpectHeight | None = None
    flight_time: ExpectFlightTime | None = None

    @property
    def check(self) -> Check:
        check: Check = next(check for _, check in self if check is not None)
        return check


# PX4 flies no faster: a larger wish is a slip of the pen.
Speed = Annotated[Positive, Field(le=defaults.MAX_SPEED_M_S)]
# One g sideways is a tilt of 45 degrees, PX4's default limit.
Acceleration = Annotated[Positive, Field(le=9.81)]
Yaw = Annotated[Number, Field(ge=-360.0, le=360.0)]


class TakeoffItem(StrictModel):
    """Climb straight up to a height above the arming position."""

    height_m: Positive
    """Above the arming position."""


class GoToItem(StrictModel):
    """Fly a straight line; without `yaw_deg` (clockwise from north) the heading stays as it is."""

    position_ned_m: PositionNed
    """North, east, down of the arming position; up is negative."""
    speed_m_s: Speed | None = None
    """At most; without one that of the last set_speed."""
    acceleration_m_s2: Acceleration | None = None
    """Of braking; the speed grows by companion.flight.speeding_up_m_s2 at most."""
    yaw_deg: Yaw | None = None
    """Heading, clockwise from north."""


class VelocityItem(StrictModel):
    """Fly with a velocity for a time, from rest to rest. Wind does not add to it; what holds it back is not made up."""

    velocity_ned_m_s: PositionNed
    """North, east, down; up is negative."""
    duration_s: Positive
    """Ramps included."""
    acceleration_m_s2: Acceleration | None = None
    """Of the ramps."""
    yaw_deg: Yaw | None = None
    """Heading, clockwise from north; without one it stays as it is."""

    @model_validator(mode="after")
    def _moves(self) -> Self:
        most_m_s = defaults.MAX_SPEED_M_S
        if not 0.0 < self.speed_m_s <= most_m_s:
            raise ValueError(f"velocity_ned_m_s: {self.speed_m_s:g} m/s is not above 0 and at most {most_m_s:g}")
        return self

    @property
    def speed_m_s(self) -> float:
        """Of the velocity; other items may leave theirs open."""
        return math.hypot(*self.velocity_ned_m_s)


class PathItem(StrictModel):
    """Fly a smooth curve through all the points without stopping, as fast as speed and acceleration allow."""

    points_ned_m: Annotated[tuple[PositionNed, ...], Field(min_length=1, max_length=200)]
    """North, east, down of the arming position; the path begins where the item before ended."""
    speed_m_s: Speed | None = None
    """At most; slower in bends."""
    acceleration_m_s2: Acceleration | None = None
    """Also across the path, in bends; there, too, companion.flight.speeding_up_m_s2 at most."""
    yaw_deg: Yaw | Literal["along"] | None = None
    """Heading, clockwise from north, or along the path."""


class OrbitItem(StrictModel):
    """Fly to the nearest point of a circle, then round it; the vehicle looks at the centre unless told otherwise."""

    centre_ned_m: PositionNed
    """North, east, down of the arming position; the circle lies at its height."""
    radius_m: Positive
    """Of the circle."""
    turns: Annotated[Positive, Field(le=1000.0)] = 1.0
    """How often round; parts of a turn count too."""
    clockwise: bool = True
    """As seen from above."""
    speed_m_s: Speed | None = None
    """Along the circle, at most."""
    acceleration_m_s2: Acceleration | None = None
    """Also towards the centre; there, too, companion.flight.speeding_up_m_s2 at most."""
    yaw_deg: Yaw | Literal["centre", "along"] | None = "centre"
    """Heading, clockwise from north, or towards the centre, or along the path."""


class HoldItem(StrictModel):
    """Stay where the vehicle is."""

    duration_s: Positive
    """From the end of the item before."""


class SteadyCondition(StrictModel):
    """The vehicle rests at its setpoint."""

    within_m: Positive = 0.2
    """Largest distance to the setpoint."""
    speed_m_s: Positive = 0.15
    """Largest speed."""
    for_s: Positive = 1.0
    """How long both must hold."""


class WaitForItem(SomeKeys):
    """Hold until a condition is met; give exactly one. `timeout_s` beside the item limits the wait."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})
    is_choice = True

    flight_time_s: Positive | None = None
    """Time since arming."""
    hit: Literal[True] | None = None
    """Something hits the waiting vehicle; what then: `on_collision`."""
    steady: SteadyCondition | None = None
    """The vehicle rests at its setpoint."""
    file: Annotated[str, Field(min_length=1)] | None = None
    """A file exists on the companion's computer: another program, or a person, gives the sign."""


class SetSpeedItem(StrictModel):
    """Speed and acceleration of all later items that state none of their own."""

    speed_m_s: Speed
    """Of the items after this one."""
    acceleration_m_s2: Acceleration | None = None
    """Of the items after this one."""


class SetYawItem(StrictModel):
    """Turn on the spot, in the shorter direction."""

    yaw_deg: Yaw
    """Heading, clockwise from north."""
    rate_deg_s: Annotated[Positive, Field(le=defaults.MAX_YAW_RATE_DEG_S)] = 45.0
    """No faster than PX4 turns."""


class ReturnItem(StrictModel):
    """Fly home and land: up to `height_m` first if the vehicle is lower, a straight line to above the start, land."""

    height_m: Positive | None = None
    """Above the arming position, at least, on the way home; never above the fence."""
    speed_m_s: Speed | None = None
    """Of the way home."""


class LandItem(StrictModel):
    """Land where the vehicle is; the flight is complete when the vehicle has disarmed itself."""


Motion: TypeAlias = GoToItem | VelocityItem | PathItem | OrbitItem
Action: TypeAlias = (
    TakeoffItem | Motion | HoldItem | WaitForItem | SetSpeedItem | SetYawItem | ExpectItem | ReturnItem | LandItem
)


# A mission longer than this once its repeats are written out is a slip of the pen.
MOST_STEPS = 10_000

# What stands beside an item's action; every other key of an item is an action.
BESIDE = ("on_collision", "timeout_s", "on_timeout")


class RepeatItem(StrictModel):
    """Fly the items one after the other, `times` times."""

    times: Annotated[int, Field(strict=True, ge=1, le=1000)]
    """How often in all."""
    items: Annotated[tuple["MissionItem", ...], Field(min_length=1)]
    """What is repeated."""


def _one_action(schema: dict[str, Any]) -> None:
    schema["oneOf"] = [{"required": [name]} for name in schema["properties"] if name not in BESIDE]
    schema["dependentRequired"] = {"on_timeout": ["timeout_s"]}


class MissionItem(StrictModel):
    """One step: a map with exactly one action, and beside it what shall be different for this item."""

    model_config = ConfigDict(json_schema_extra=_one_action)
    bare = frozenset({"land", "return"})

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
    on_timeout: Literal["abort", "continue", "return", "land"] = "abort"
    """What follows then; abort hands the vehicle over as on_interrupt says."""

    @model_validator(mode="after")
    def _exactly_one_action(self) -> Self:
        if len(self._given) != 1:
            names = ", ".join(field.removesuffix("_") for field in type(self).model_fields if field not in BESIDE)
            raise ValueError(f"an item is a map with exactly one key of: {names}")
        if self.on_timeout != "abort" and self.timeout_s is None:
            raise ValueError("on_timeout says what follows a time-out: give timeout_s too")
        if self.name in ("takeoff", "land", "return", "repeat") and self.timeout_s is not None:
            raise ValueError(f"timeout_s has no meaning beside {self.name}")
        if self.name in ("takeoff", "land", "repeat") and self.on_collision is not None:
            raise ValueError(f"on_collision has no meaning beside {self.name}")
        return self

    @property
    def _given(self) -> dict[str, Any]:
        return {field.removesuffix("_"): value for field, value in self if value is not None and field not in BESIDE}

    @property
    def name(self) -> str:
        return next(iter(self._given))

    @property
    def action(self) -> Action:
        """What is done; a repeat is no action of its own but what stands in it (see `program`)."""
        assert self.repeat is None
        action: Action = self._given[self.name]
        return action


# Now that there is what it is made of.
RepeatItem.model_rebuild()


@dataclass(frozen=True, slots=True)
class Step:
    """`label` is the item's number as people count, "4.2 (2 of 3)" for the second lap of a repeat.

    `index` is the step's place in the whole program, for taking up an interrupted mission again.
    """

    index: int
    label: str
    item: MissionItem
    action: Action


def program(items: tuple[MissionItem, ...]) -> tuple[Step, ...]:
    """All steps in the order in which they are flown. Raises ValueError when they are too many."""
    labelled = list(islice(_labelled(items, "", ""), MOST_STEPS + 1))
    if len(labelled) > MOST_STEPS:
        raise ValueError(f"items: more than {MOST_STEPS} steps once the repeats are written out")
    return tuple(Step(index, label, item, item.action) for index, (label, item) in enumerate(labelled))


def _labelled(items: tuple[MissionItem, ...], before: str, lap: str) -> Iterator[tuple[str, MissionItem]]:
    for number, item in enumerate(items, start=1):
        if item.repeat is None:
            yield f"{before}{number}{lap}", item
            continue
        for count in range(1, item.repeat.times + 1):
            yield from _labelled(item.repeat.items, f"{before}{number}.", f"{lap} ({count} of {item.repeat.times})")
