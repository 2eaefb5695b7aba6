"""Where the nose points: a fixed heading, along the way, or at a place; turned to at a limited rate."""

import math
from dataclasses import dataclass

from companion.messages import Vector3
from companion.mission.items import OrbitItem, PathItem, SetYawItem
from companion.mission.program import Step

# Below PX4's MC_YAWRATE_MAX (200 deg/s) and its MPC_YAWRAUTO_MAX (45 deg/s): the vehicle can follow.
YAW_RATE_RAD_S = math.radians(45.0)
# Slower, or nearer, than this there is no direction that noise in the last digits could not have made.
_LEAST_SPEED_M_S = 0.05
_LEAST_DISTANCE_M = 0.05


@dataclass(slots=True)
class Heading:
    """A heading on its way to another. Radians clockwise from north; None: the vehicle's own affair."""

    yaw_rad: float | None
    at_us: int
    rate_rad_s: float
    fixed_rad: float | None
    centre_m: Vector3 | None = None
    along: bool = False

    @classmethod
    def of_step(cls, step: Step, yaw_rad: float | None, now_us: int) -> "Heading":
        """The heading that the step asks for, beginning with the present one."""
        action = step.action
        rate_rad_s = math.radians(action.rate_deg_s) if isinstance(action, SetYawItem) else YAW_RATE_RAD_S
        asked = getattr(action, "yaw_deg", None)
        fixed_rad = math.radians(asked) if isinstance(asked, float | int) else yaw_rad
        centre = action.centre_ned_m if isinstance(action, OrbitItem) and asked == "centre" else None
        along = isinstance(action, PathItem | OrbitItem) and asked == "along"
        return cls(yaw_rad, now_us, rate_rad_s, fixed_rad, centre, along)

    @property
    def is_fixed(self) -> bool:
        return self.centre_m is None and not self.along

    @property
    def is_reached(self) -> bool:
        """Of a fixed heading; one that follows the way is never late."""
        return not self.is_fixed or self.yaw_rad == self.fixed_rad

    def turn(self, position_m: Vector3, velocity_m_s: Vector3, now_us: int) -> float | None:
        """Turn on until now, the shorter way."""
        wanted = self._wanted(position_m, velocity_m_s)
        elapsed_s, self.at_us = (now_us - self.at_us) * 1e-6, now_us
        if wanted is None or self.yaw_rad is None:
            self.yaw_rad = wanted
            return wanted
        way = math.remainder(wanted - self.yaw_rad, math.tau)
        step = self.rate_rad_s * elapsed_s
        self.yaw_rad = wanted if abs(way) <= step else self.yaw_rad + math.copysign(step, way)
        return self.yaw_rad

    def _wanted(self, position_m: Vector3, velocity_m_s: Vector3) -> float | None:
        if self.centre_m is not None:
            north, east = self.centre_m[0] - position_m[0], self.centre_m[1] - position_m[1]
            return math.atan2(east, north) if math.hypot(north, east) > _LEAST_DISTANCE_M else self.yaw_rad
        if self.along:
            north, east, _ = velocity_m_s
            return math.atan2(east, north) if math.hypot(north, east) > _LEAST_SPEED_M_S else self.yaw_rad
        return self.fixed_rad
