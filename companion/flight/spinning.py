"""A vehicle that spins about its own axis leans late and beside where it is asked to: it is steered gently meanwhile.

The spin is a gyroscope. With a rate r an attitude loop of bandwidth b follows what is asked with a delay that grows by
a factor of sqrt(1 + (r / b)^2), on a spiral, turned by atan(r / b) on its way. Around so slow a lean a velocity loop as
quick as PX4's is unstable: from some 10 rad/s on the vehicle circles with a growing lean and sinks to the ground. One
that asks for 1.2/s, by accelerations alone, is stable up to 20 rad/s. A spin dies away by yaw alone, which motors turn
with a few radians a second each second.
"""

from dataclasses import dataclass

from companion.estimate.rotation import body_to_ned
from companion.flight.context import FlightContext
from companion.flight.leaning import Flat, lean_of
from companion.messages import Attitude, LocalPosition, Vector3

# A glancing hit on one guard spins the vehicle, at 5 m/s with up to 16 rad/s, on a pole with 24. What it leans to is
# then turned away from what was asked by rate times lag: 6 rad/s times 0.2 s are 70 degrees.
SPINNING_RAD_S = 6.0
# Twice damped at 0.6/s: nowhere near the 2/s with which a lean still follows at 20 rad/s.
SPEED_PER_S = 1.2
PLACE_PER_S2 = 0.36
# A lean of 17 degrees, as that of every recovery.
MOST_M_S2 = 3.0
# Wind is what the lean does in vain, in the mean of so long: slower than the steering, faster than the drift.
WIND_S = 1.0


def spin_rad_s(attitude: Attitude | None) -> float:
    """How fast the vehicle turns about the vertical; 0 where that is not heard."""
    if attitude is None or attitude.angular_velocity_frd_rad_s is None:
        return 0.0
    return abs(body_to_ned(attitude.attitude_wxyz, attitude.angular_velocity_frd_rad_s)[2])


def is_spinning(flight: FlightContext) -> bool:
    return spin_rad_s(flight.vehicle.attitude) > SPINNING_RAD_S


@dataclass(slots=True)
class Steering:
    """To rest, by accelerations alone; followed with each position while the vehicle spins. Local NED."""

    goal_ned_m: Vector3
    acceleration_m_s2: Flat = (0.0, 0.0)
    time_us: int = 0
    velocity_m_s: Flat = (0.0, 0.0)
    against_wind_m_s2: Flat = (0.0, 0.0)

    def step(self, sample: LocalPosition, attitude: Attitude) -> None:
        (x, y, _), (u, v, _), (a, b, _) = sample.position_ned_m, sample.velocity_ned_m_s, self.goal_ned_m
        elapsed_s = (sample.time_boot_us - self.time_us) * 1e-6
        if self.time_us and elapsed_s > 0.0:
            weight = elapsed_s / (WIND_S + elapsed_s)
            (n, e), (p, q), (k, m) = lean_of(attitude.attitude_wxyz), self.velocity_m_s, self.against_wind_m_s2
            k += weight * (n - (u - p) / elapsed_s - k)
            m += weight * (e - (v - q) / elapsed_s - m)
            self.against_wind_m_s2 = (k, m)
        self.time_us, self.velocity_m_s = sample.time_boot_us, (u, v)
        north = PLACE_PER_S2 * (a - x) - SPEED_PER_S * u + self.against_wind_m_s2[0]
        east = PLACE_PER_S2 * (b - y) - SPEED_PER_S * v + self.against_wind_m_s2[1]
        scale = min(1.0, MOST_M_S2 / max((north * north + east * east) ** 0.5, 1e-9))
        self.acceleration_m_s2 = (scale * north, scale * east)


def coming_to_rest(place_ned_m: Vector3, velocity_ned_m_s: Vector3, down_m: float) -> Vector3:
    """Where so gentle a steering brings a vehicle to rest that nothing else holds; at a height."""
    (n, e, _), (u, v, _) = place_ned_m, velocity_ned_m_s
    return (n + u / SPEED_PER_S, e + v / SPEED_PER_S, down_m)
