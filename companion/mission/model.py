"""The mission file as a model. Coordinates: NED, relative to the arming position, aligned north."""

import math
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import Field, field_validator, model_validator

from companion.mission.config import CompanionConfig
from companion.recovery.interface import RecoveryConfig
from companion.recovery.registry import RECOVERY_LAWS, check_known_law
from companion.written import NotNegative, Number, PositionNed, Positive, Written

# PX4 flies no faster than MPC_XY_VEL_MAX, 12 m/s by default: a larger wish is a slip of the pen.
MAX_SPEED_M_S = 12.0
# One g sideways is a tilt of 45 degrees, PX4's default limit MPC_TILTMAX_AIR.
MAX_ACCELERATION_M_S2 = 9.81

Handover: TypeAlias = Literal["hold", "land"]


class TakeoffItem(Written):
    """Climb to a height above the arming position."""

    height_m: Positive


class GoToItem(Written):
    """Fly a straight line; without `yaw_deg` (clockwise from north) the heading stays as it is."""

    position_ned_m: PositionNed
    speed_m_s: Annotated[Positive, Field(le=MAX_SPEED_M_S)]
    acceleration_m_s2: Annotated[Positive, Field(le=MAX_ACCELERATION_M_S2)] = 2.0
    yaw_deg: Annotated[Number, Field(ge=-360.0, le=360.0)] | None = None


class HoldItem(Written):
    """Stay where the vehicle is."""

    duration_s: Positive


class LandItem(Written):
    """Land where the vehicle is; the flight is complete when the vehicle has disarmed itself."""


Action: TypeAlias = TakeoffItem | GoToItem | HoldItem | LandItem


class MissionItem(Written):
    """One step: a map with exactly one key."""

    takeoff: TakeoffItem | None = None
    go_to: GoToItem | None = None
    hold: HoldItem | None = None
    land: LandItem | None = None

    @field_validator("land", mode="before")
    @classmethod
    def _bare_land(cls, value: object) -> object:
        """`- land:` without braces reads as null in YAML and means the same."""
        return {} if value is None else value

    @model_validator(mode="after")
    def _exactly_one_key(self) -> Self:
        if len(self.model_fields_set) != 1:
            raise ValueError("an item is a map with exactly one key: takeoff, go_to, hold or land")
        return self

    @property
    def name(self) -> str:
        return next(iter(self.model_fields_set))

    @property
    def action(self) -> Action:
        action = self.takeoff or self.go_to or self.hold or self.land
        assert action is not None, "the validator admits exactly one key"
        return action


class OnCollision(Written):
    """After the recovery: hold for `hold_s` and go on, go on at once (`continue`), or land."""

    then: Literal["hold", "continue", "land"] = "hold"
    hold_s: NotNegative = 3.0


class Fence(Written):
    """A cylinder around the arming position that no setpoint leaves."""

    radius_m: Positive = 15.0
    max_height_m: Positive = 6.0

    def complaint(self, position_ned_m: PositionNed) -> str | None:
        """What is wrong with a position in mission coordinates, or None when it is inside."""
        north_m, east_m, down_m = position_ned_m
        distance_m = math.hypot(north_m, east_m)
        if distance_m > self.radius_m:
            return f"lies {distance_m:.2f} m out, beyond fence.radius_m = {self.radius_m:g}"
        if -down_m > self.max_height_m:
            return f"lies {-down_m:.2f} m up, above fence.max_height_m = {self.max_height_m:g}"
        if down_m >= 0.0:
            return f"has down = {down_m:g} m, which is not above the ground; up is negative"
        return None


class Mission(Written):
    """A whole mission file. `sim` belongs to the simulated vehicle and is ignored in a real flight."""

    name: Annotated[str, Field(min_length=1, pattern=r"^[A-Za-z0-9._-]+$")]
    description: str = ""
    fence: Fence = Fence()
    items: Annotated[tuple[MissionItem, ...], Field(min_length=2)]
    on_collision: OnCollision = OnCollision()
    recovery: RecoveryConfig = RecoveryConfig()
    on_interrupt: Handover = "hold"
    companion: CompanionConfig = CompanionConfig()
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
        if names[-1] != "land":
            raise ValueError(f"items: the last item must be land, not {names[-1]}")
        for number, name in enumerate(names[1:-1], start=2):
            if name in ("takeoff", "land"):
                raise ValueError(f"items: item {number} is {name}, which may only come first (takeoff) or last (land)")
        return self

    @model_validator(mode="after")
    def _items_inside_fence(self) -> Self:
        for number, item in enumerate(self.items, start=1):
            complaint = None
            if item.go_to is not None:
                complaint = self.fence.complaint(item.go_to.position_ned_m)
            elif item.takeoff is not None:
                complaint = self.fence.complaint((0.0, 0.0, -item.takeoff.height_m))
            if complaint is not None:
                raise ValueError(f"items: the position of item {number} ({item.name}) {complaint}")
        return self
