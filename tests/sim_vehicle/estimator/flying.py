"""A vehicle that flies by its own filter, and how wrong the filter is."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from sim_vehicle.airframe import Airframe, with_base
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.plant.plant import Plant
from sim_vehicle.quantities import Floats
from sim_vehicle.scene import Scene
from tests.sim_vehicle.physics.throwing import flown

HEIGHT_M = 1.5
STEP_S = 0.004
WITH_CAMERAS = {"sensors": {"motion_capture": {"fitted": True}}}


def filtered(base: str = "foldable", changes: dict[str, Any] | None = None) -> Airframe:
    """A built-in airframe with its filter on."""
    return Airframe.model_validate(with_base({"based_on": base, "estimate": {"kind": "ekf"}, **(changes or {})}))


class Flight:
    """Two seconds on the ground, then whatever is asked."""

    def __init__(self, airframe: Airframe, seed: int = 1, scene: Scene | None = None) -> None:
        self.plant = Plant(airframe, scene or Scene(), seed)
        self.output = flown(self.plant, None, 2.0)[-1]

    @property
    def velocity_error_m_s(self) -> Floats:
        return np.array(self.output.velocity_ned_m_s) - self.plant.state.body[3:6]

    @property
    def position_error_m(self) -> Floats:
        return np.array(self.output.position_ned_m) - self.plant.state.body[0:3]

    def fly(self, setpoint: TrajectorySetpoint, seconds: float) -> Floats:
        """Fly the setpoint; velocity errors (n, 3)."""
        errors = []
        for _ in range(round(seconds / STEP_S)):
            self.output = self.plant.step(setpoint, armed=True)
            errors.append(self.velocity_error_m_s)
        return np.array(errors)

    def fly_along(self, setpoint_at: Callable[[float], TrajectorySetpoint], seconds: float) -> Floats:
        """The same with a setpoint of time since the start of the call."""
        errors = [self.fly(setpoint_at(STEP_S * n), STEP_S) for n in range(round(seconds / STEP_S))]
        return np.concatenate(errors)

    def climb(self) -> None:
        """To `HEIGHT_M`, and still there."""
        self.fly(HOVER, 6.0)


HOVER = TrajectorySetpoint(position_ned_m=(0.0, 0.0, -HEIGHT_M), yaw_rad=0.0)


def circle(radius_m: float, speed_m_s: float) -> Callable[[float], TrajectorySetpoint]:
    """Round a circle that begins at the origin, northwards."""

    def setpoint_at(time_s: float) -> TrajectorySetpoint:
        angle = speed_m_s / radius_m * time_s
        north, east = radius_m * math.sin(angle), radius_m * (1 - math.cos(angle))
        velocity = (speed_m_s * math.cos(angle), speed_m_s * math.sin(angle), 0.0)
        return TrajectorySetpoint((north, east, -HEIGHT_M), velocity, yaw_rad=0.0)

    return setpoint_at


def hit_wall(airframe: Airframe, speed_m_s: float, after_ms: tuple[int, ...]) -> tuple[Flight, list[float]]:
    """Fly head-on at a wall and, from the touch on, to half a second's way behind it, as the paper's eq. 3.

    And the length of the velocity error, m/s, before the touch and at these times after it.
    """
    distance_m = 2 + 0.75 * speed_m_s**2
    scene = Scene.model_validate({"walls": [{"point_ned_m": [distance_m, 0, -HEIGHT_M], "normal_ned": [-1, 0, 0]}]})
    flight = Flight(airframe, 1, scene)
    flight.climb()
    time_s, now_ms, errors_m_s = 0.0, 0, [math.nan]
    reach_m = distance_m - airframe.geometry.reach_m * math.cos(math.pi / 4) - 1.0
    while flight.plant.state.peak_force_n == 0.0:
        errors_m_s = [float(np.linalg.norm(flight.velocity_error_m_s))]
        last = flight.output
        speeding_up_m_s = min(speed_m_s, 2.0 * time_s)
        north = TrajectorySetpoint((None, 0.0, -HEIGHT_M), (speeding_up_m_s, None, None), yaw_rad=0.0)
        flight.fly(north, STEP_S)
        time_s += STEP_S
        assert flight.plant.state.body[0] < reach_m + 2.0, "the wall was passed"
    v_c, x_c = last.velocity_ned_m_s[0], last.position_ned_m[0]
    back = TrajectorySetpoint(position_ned_m=(x_c - 0.5 * v_c, 0.0, -HEIGHT_M), yaw_rad=0.0)
    for moment in after_ms:
        flight.fly(back, 1e-3 * (moment - now_ms))
        now_ms = moment
        errors_m_s.append(float(np.linalg.norm(flight.velocity_error_m_s)))
    return flight, errors_m_s
