"""A setpoint that moves to its target within limits of speed and acceleration (no limit of jerk)."""

import math

Vector3 = tuple[float, float, float]

# PX4's MPC_ACC_HOR, MPC_ACC_UP_MAX and MPC_ACC_DOWN_MAX.
ACCELERATION_HORIZONTAL_M_S2 = 3.0
ACCELERATION_UP_M_S2 = 4.0
ACCELERATION_DOWN_M_S2 = 3.0
# MPC_XY_CRUISE, MPC_Z_V_AUTO_UP and MPC_Z_V_AUTO_DN.
CRUISE_M_S = 5.0
CLIMB_M_S = 3.0
DESCENT_M_S = 1.5
# MPC_JERK_AUTO: here only for the distance that PX4 allows itself for braking.
JERK_M_S3 = 4.0
# PX4 limits jerk too, and so brakes with about half of the greatest acceleration on average.
BRAKE_SHARE = 0.5


def stop_point(position_ned_m: Vector3, velocity_ned_m_s: Vector3) -> Vector3:
    """Where a vehicle that brakes now will stand, height kept (PX4's Navigator::preproject_stop_point)."""
    north, east, down = position_ned_m
    v_north, v_east, _ = velocity_ned_m_s
    # d = v (v / 2a + t): t is the time in which the acceleration builds up.
    seconds = math.hypot(v_north, v_east) / (2 * ACCELERATION_HORIZONTAL_M_S2)
    seconds += 0.6 * JERK_M_S3 / JERK_M_S3
    return north + v_north * seconds, east + v_east * seconds, down


class Smoother:
    """Position, velocity and acceleration of the moving setpoint, local NED."""

    def __init__(self) -> None:
        self.position_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self.velocity_ned_m_s: Vector3 = (0.0, 0.0, 0.0)
        self.acceleration_ned_m_s2: Vector3 = (0.0, 0.0, 0.0)

    def start(self, position_ned_m: Vector3, velocity_ned_m_s: Vector3) -> None:
        """Begin where the vehicle is, as fast as it is."""
        self.position_ned_m = position_ned_m
        self.velocity_ned_m_s = velocity_ned_m_s
        self.acceleration_ned_m_s2 = (0.0, 0.0, 0.0)

    def advance(self, target_ned_m: Vector3, step_s: float) -> None:
        """Move on towards the target by one step."""
        north, east, down = self.position_ned_m
        before = v_north, v_east, v_down = self.velocity_ned_m_s
        to_north, to_east = target_ned_m[0] - north, target_ned_m[1] - east
        distance = math.hypot(to_north, to_east)
        speed = _braking_speed(distance, ACCELERATION_HORIZONTAL_M_S2, CRUISE_M_S, step_s)
        per_metre = speed / distance if distance > 0 else 0.0
        change_north, change_east = to_north * per_metre - v_north, to_east * per_metre - v_east
        share = _share(math.hypot(change_north, change_east), ACCELERATION_HORIZONTAL_M_S2 * step_s)
        v_north, v_east = v_north + share * change_north, v_east + share * change_east
        v_down = vertical_velocity(v_down, target_ned_m[2] - down, step_s)
        self.velocity_ned_m_s = (v_north, v_east, v_down)
        self.acceleration_ned_m_s2 = (
            (v_north - before[0]) / step_s,
            (v_east - before[1]) / step_s,
            (v_down - before[2]) / step_s,
        )
        self.position_ned_m = (north + v_north * step_s, east + v_east * step_s, down + v_down * step_s)


def vertical_velocity(velocity_down_m_s: float, distance_down_m: float, step_s: float) -> float:
    """The next downward velocity of a setpoint ``distance_down_m`` away from its height."""
    if distance_down_m < 0.0:
        wanted = -_braking_speed(-distance_down_m, ACCELERATION_UP_M_S2, CLIMB_M_S, step_s)
        return towards(velocity_down_m_s, wanted, ACCELERATION_UP_M_S2 * step_s)
    wanted = _braking_speed(distance_down_m, ACCELERATION_DOWN_M_S2, DESCENT_M_S, step_s)
    return towards(velocity_down_m_s, wanted, ACCELERATION_DOWN_M_S2 * step_s)


def towards(value: float, target: float, most: float) -> float:
    """``value`` moved to ``target`` by at most ``most``."""
    return min(max(target, value - most), value + most)


def _braking_speed(distance_m: float, acceleration_m_s2: float, most_m_s: float, step_s: float) -> float:
    """The speed from which the setpoint can still stop at the target, and not pass it in one step."""
    return min(most_m_s, math.sqrt(2 * BRAKE_SHARE * acceleration_m_s2 * distance_m), distance_m / step_s)


def _share(length: float, most: float) -> float:
    """How much of a change of that length may happen."""
    return 1.0 if length <= most else most / length
