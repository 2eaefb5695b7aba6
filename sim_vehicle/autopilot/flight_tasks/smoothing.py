"""A setpoint that moves to its target within limits of speed and acceleration (no limit of jerk).

Source: PX4's lib/motion_planning (PositionSmoothing) and its parameters, which also limit the jerk.
"""

import math

from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Vector3

# PX4 limits jerk too, and so brakes with about half of the greatest acceleration on average.
BRAKE_SHARE = 0.5
# Navigator::preproject_stop_point: the time in which the acceleration builds up.
_BUILD_UP_S = 0.6


def stop_point(position_ned_m: Vector3, velocity_ned_m_s: Vector3, parameters: Parameters) -> Vector3:
    """Where a vehicle that brakes now will stand, height kept (PX4's Navigator::preproject_stop_point)."""
    north, east, down = position_ned_m
    v_north, v_east, _ = velocity_ned_m_s
    # d = v (v / 2a + t)
    seconds = math.hypot(v_north, v_east) / (2 * parameters["MPC_ACC_HOR"]) + _BUILD_UP_S
    return north + v_north * seconds, east + v_east * seconds, down


class Smoother:
    """Position, velocity, acceleration and heading of the moving setpoint, local NED."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.position_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self.velocity_ned_m_s: Vector3 = (0.0, 0.0, 0.0)
        self.acceleration_ned_m_s2: Vector3 = (0.0, 0.0, 0.0)
        self.yaw_rad = 0.0

    @property
    def setpoint(self) -> TrajectorySetpoint:
        """Where it is now."""
        return TrajectorySetpoint(
            self.position_ned_m, self.velocity_ned_m_s, self.acceleration_ned_m_s2, yaw_rad=self.yaw_rad
        )

    def start(self, position_ned_m: Vector3, velocity_ned_m_s: Vector3) -> None:
        """Begin where the vehicle is, as fast as it is."""
        self.position_ned_m = position_ned_m
        self.velocity_ned_m_s = velocity_ned_m_s
        self.acceleration_ned_m_s2 = (0.0, 0.0, 0.0)

    def advance(self, target_ned_m: Vector3, step_s: float, cruise_m_s: float) -> None:
        """Move on towards the target by one step."""
        north, east, down = self.position_ned_m
        before = v_north, v_east, v_down = self.velocity_ned_m_s
        to_north, to_east = target_ned_m[0] - north, target_ned_m[1] - east
        most_m_s2 = self._parameters["MPC_ACC_HOR"]
        distance = math.hypot(to_north, to_east)
        speed = _braking_speed(distance, most_m_s2, cruise_m_s, step_s)
        per_metre = speed / distance if distance > 0 else 0.0
        v_north, v_east = slewed((v_north, v_east), (to_north * per_metre, to_east * per_metre), most_m_s2 * step_s)
        v_down = self.vertical_velocity(v_down, target_ned_m[2] - down, step_s)
        self.velocity_ned_m_s = (v_north, v_east, v_down)
        self.acceleration_ned_m_s2 = (
            (v_north - before[0]) / step_s,
            (v_east - before[1]) / step_s,
            (v_down - before[2]) / step_s,
        )
        self.position_ned_m = (north + v_north * step_s, east + v_east * step_s, down + v_down * step_s)

    def turn(self, yaw_rad: float, step_s: float) -> None:
        """Turn on the short way towards a heading, as fast as MPC_YAWRAUTO_MAX."""
        most_rad = math.radians(self._parameters["MPC_YAWRAUTO_MAX"]) * step_s
        difference = math.remainder(yaw_rad - self.yaw_rad, 2 * math.pi)
        self.yaw_rad = math.remainder(self.yaw_rad + towards(0.0, difference, most_rad), 2 * math.pi)

    def vertical_velocity(self, velocity_down_m_s: float, distance_down_m: float, step_s: float) -> float:
        """The next downward velocity of a setpoint ``distance_down_m`` away from its height."""
        parameters = self._parameters
        if distance_down_m < 0.0:
            most_m_s2 = parameters["MPC_ACC_UP_MAX"]
            wanted = -_braking_speed(-distance_down_m, most_m_s2, parameters["MPC_Z_V_AUTO_UP"], step_s)
        else:
            most_m_s2 = parameters["MPC_ACC_DOWN_MAX"]
            wanted = _braking_speed(distance_down_m, most_m_s2, parameters["MPC_Z_V_AUTO_DN"], step_s)
        return towards(velocity_down_m_s, wanted, most_m_s2 * step_s)


def towards(value: float, target: float, most: float) -> float:
    """``value`` moved to ``target`` by at most ``most``."""
    return min(max(target, value - most), value + most)


def slewed(value: tuple[float, float], target: tuple[float, float], most: float) -> tuple[float, float]:
    """The same for a vector in a plane."""
    change = (target[0] - value[0], target[1] - value[1])
    length = math.hypot(*change)
    share = 1.0 if length <= most else most / length
    return value[0] + share * change[0], value[1] + share * change[1]


def _braking_speed(distance_m: float, acceleration_m_s2: float, most_m_s: float, step_s: float) -> float:
    """The speed from which the setpoint can still stop at the target, and not pass it in one step."""
    return min(most_m_s, math.sqrt(2 * BRAKE_SHARE * acceleration_m_s2 * distance_m), distance_m / step_s)
