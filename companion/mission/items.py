"""What can stand in a mission's `items`: one class each. Coordinates: NED, relative to the arming position."""

from typing import Annotated, Literal, Self, TypeAlias

from pydantic import ConfigDict, Field, model_validator

from companion.mission.expectations import ExpectItem
from companion.written import Number, PositionNed, Positive, Written

# PX4 flies no faster than MPC_XY_VEL_MAX, 12 m/s by default: a larger wish is a slip of the pen.
MAX_SPEED_M_S = 12.0
# One g sideways is a tilt of 45 degrees, PX4's default limit MPC_TILTMAX_AIR.
MAX_ACCELERATION_M_S2 = 9.81
# MC_YAWRATE_MAX, 200 deg/s by default.
MAX_YAW_RATE_DEG_S = 200.0

Speed = Annotated[Positive, Field(le=MAX_SPEED_M_S)]
Acceleration = Annotated[Positive, Field(le=MAX_ACCELERATION_M_S2)]
Yaw = Annotated[Number, Field(ge=-360.0, le=360.0)]


class TakeoffItem(Written):
    """Climb straight up to a height above the arming position."""

    height_m: Positive
    """Above the arming position."""


class GoToItem(Written):
    """Fly a straight line; without `yaw_deg` (clockwise from north) the heading stays as it is."""

    position_ned_m: PositionNed
    """North, east, down of the arming position; up is negative."""
    speed_m_s: Speed | None = None
    """At most; without one that of the last set_speed."""
    acceleration_m_s2: Acceleration | None = None
    """Of braking and turning; the speed grows by companion.flight.speeding_up_m_s2 at most."""
    yaw_deg: Yaw | None = None
    """Heading, clockwise from north."""


class VelocityItem(Written):
    """Fly with a velocity for a time, from rest to rest; the setpoint moves on, so that wind does not add to it."""

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
        speed_m_s = sum(component**2 for component in self.velocity_ned_m_s) ** 0.5
        if not 0.0 < speed_m_s <= MAX_SPEED_M_S:
            raise ValueError(f"velocity_ned_m_s: {speed_m_s:g} m/s is not above 0 and at most {MAX_SPEED_M_S:g}")
        return self


class PathItem(Written):
    """Fly a smooth curve through all the points without stopping, as fast as speed and acceleration allow."""

    points_ned_m: Annotated[tuple[PositionNed, ...], Field(min_length=1, max_length=200)]
    """North, east, down of the arming position; the way begins where the item before ended."""
    speed_m_s: Speed | None = None
    """At most; slower in bends."""
    acceleration_m_s2: Acceleration | None = None
    """Also across the way, in bends."""
    yaw_deg: Yaw | Literal["along"] | None = None
    """Heading, clockwise from north, or along the way."""


class OrbitItem(Written):
    """Fly to the nearest point of a circle, then round it; the vehicle looks at the centre unless told otherwise."""

    centre_ned_m: PositionNed
    """North, east, down of the arming position; the circle lies at its height."""
    radius_m: Positive
    """From the centre to the way."""
    turns: Annotated[Positive, Field(le=1000.0)] = 1.0
    """How often round; parts of a turn count too."""
    clockwise: bool = True
    """As seen from above."""
    speed_m_s: Speed | None = None
    """Along the circle, at most."""
    acceleration_m_s2: Acceleration | None = None
    """Also towards the centre."""
    yaw_deg: Yaw | Literal["centre", "along"] | None = "centre"
    """Heading, clockwise from north, or towards the centre, or along the way."""


class HoldItem(Written):
    """Stay where the vehicle is."""

    duration_s: Positive
    """From the end of the item before."""


class SteadyCondition(Written):
    """The vehicle rests at its setpoint."""

    within_m: Positive = 0.2
    """So near to the setpoint ..."""
    speed_m_s: Positive = 0.15
    """... and so slow ..."""
    for_s: Positive = 1.0
    """... for so long."""


class WaitForItem(Written):
    """Hold until something is so: give exactly one condition. `timeout_s` beside the item limits the patience."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    flight_time_s: Positive | None = None
    """So long after arming."""
    hit: Literal[True] | None = None
    """Something hits the waiting vehicle; what then: `on_collision`."""
    steady: SteadyCondition | None = None
    """The vehicle rests at its setpoint."""
    file: Annotated[str, Field(min_length=1)] | None = None
    """A file exists on the companion's computer: another program, or a person, gives the sign."""

    @model_validator(mode="after")
    def _exactly_one(self) -> Self:
        if len(self.model_dump(exclude_none=True)) != 1:
            raise ValueError(f"give exactly one condition: {', '.join(WaitForItem.model_fields)}")
        return self


class SetSpeedItem(Written):
    """Speed and acceleration of all later items that state none of their own."""

    speed_m_s: Speed
    """Of the items after this one."""
    acceleration_m_s2: Acceleration | None = None
    """Of the items after this one."""


class SetYawItem(Written):
    """Turn on the spot, the shorter way."""

    yaw_deg: Yaw
    """Heading, clockwise from north."""
    rate_deg_s: Annotated[Positive, Field(le=MAX_YAW_RATE_DEG_S)] = 45.0
    """PX4's own limit is MC_YAWRATE_MAX."""


class ReturnItem(Written):
    """Fly home and land: up to `height_m` first if the vehicle is lower, a straight line to above the start, land."""

    height_m: Positive | None = None
    """Above the arming position, at least, on the way home; never above the fence."""
    speed_m_s: Speed | None = None
    """Of the way home."""


class LandItem(Written):
    """Land where the vehicle is; the flight is complete when the vehicle has disarmed itself."""


Motion: TypeAlias = GoToItem | VelocityItem | PathItem | OrbitItem
Action: TypeAlias = (
    TakeoffItem | Motion | HoldItem | WaitForItem | SetSpeedItem | SetYawItem | ExpectItem | ReturnItem | LandItem
)
