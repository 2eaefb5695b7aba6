"""A vehicle flown straight at a wall, with nothing between the setpoint and the physics."""

import math
from typing import Any

import numpy as np

from sim_vehicle.airframe import Airframe
from sim_vehicle.control.setpoint import Setpoint
from sim_vehicle.estimator.estimate import Estimate
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit

HEIGHT_M = 2.0


def quiet(airframe: Airframe, **changes: object) -> Airframe:
    """The airframe without drag, noise and bias: what is left is eq. 1, eq. 2 and the loops."""
    data = airframe.model_dump()
    data["drag_n_s_m"] = 0.0
    for key in ("accelerometer_noise_m_s2", "accelerometer_bias_m_s2", "gyroscope_noise_rad_s"):
        data["imu"][key] = 0.0
    data["imu"]["gyroscope_bias_rad_s"] = 0.0
    data["estimate"]["kind"] = "markov"
    data["estimate"]["clipping"] = None
    for key in ("position_noise_m", "velocity_noise_m_s", "attitude_noise_rad"):
        data["estimate"][key] = 0.0
    for path, value in changes.items():
        part, _, key = path.partition("__")
        if key:
            data[part][key] = value
        else:
            data[part] = value
    return Airframe.model_validate(data)


def flown(plant: Plant, setpoint: Setpoint | None, seconds: float) -> list[Estimate]:
    """What it takes itself for in each interval of so long behind a setpoint, or without thrust."""
    intervals = range(round(seconds / (1e-6 * plant.interval_us)))
    return [plant.step(setpoint, armed=setpoint is not None) for _ in intervals]


def motors_off(plant: Plant, seconds: float) -> Plant:
    """The plant after so long without thrust."""
    flown(plant, None, seconds)
    return plant


def thrown(
    airframe: Airframe,
    scene: dict,
    position=(1.5, 0.0, -8.0),
    velocity=(2.0, 0.0, 0.0),
    yaw_rad=0.0,
    rates=(0.0, 0.0, 0.0),
    lean=(0.0, 0.0),
    duration_s=0.48,
) -> Plant:
    """A vehicle without thrust, let go among obstacles; ``lean``: its quaternion's x and y, before it has length 1."""
    plant = Plant(airframe, Scene.model_validate(scene), seed=1)
    plant.place(position, velocity)
    attitude_wxyz = np.array([math.cos(yaw_rad / 2), *lean, math.sin(yaw_rad / 2)])
    plant.state.body[6:10] = attitude_wxyz / np.linalg.norm(attitude_wxyz)
    plant.state.body[10:13] = rates
    return motors_off(plant, duration_s)


def released(airframe: Airframe, seconds: float, **scene: object) -> Plant:
    """High up, at rest, and let go."""
    return thrown(airframe, scene, (0.0, 0.0, -50.0), (0.0, 0.0, 0.0), duration_s=seconds)


def throw(
    airframe: Airframe,
    speed_m_s: float,
    yaw_rad: float = 0.0,
    gap_m: float = 0.05,
    rates_frd_rad_s: tuple[float, float, float] = (0.0, 0.0, 0.0),
    duration_s: float = 0.4,
) -> Plant:
    """Throw a level vehicle, motors off, north at a wall; the plant after its hit.

    Motors off leave eq. 2 alone (thrust level would only cancel gravity): the vehicle falls as it hits,
    along the frictionless face.
    """
    free = airframe.model_copy(update={"surface": airframe.surface.model_copy(update={"guard_friction": 0.0})})
    wall = {"point_ned_m": [10, 0, -HEIGHT_M], "normal_ned": [-1, 0, 0], "width_m": 20, "height_m": 20}
    scene = Scene.model_validate({"walls": [wall], "start": {"yaw_deg": math.degrees(yaw_rad)}})
    plant = Plant(free, scene, seed=1)
    plant.state.body[0:3] = [10 - airframe.geometry.reach_m - gap_m, 0.0, -HEIGHT_M]
    plant.state.body[3:6] = [speed_m_s, 0.0, 0.0]
    plant.state.body[10:13] = rates_frd_rad_s
    return motors_off(plant, duration_s)


def first_hit(airframe: Airframe, speed_m_s: float, **more: Any) -> Hit:
    """The same; of its hits the first."""
    return throw(airframe, speed_m_s, **more).truth.hits[0]


def closed_form_of_eq_2(airframe: Airframe, speed_m_s: float) -> tuple[float, float, float]:
    """Rebound speed, contact time and greatest fold of eq. 2, ended where its force is back at zero."""
    b, k = airframe.arms.damping_per_s, airframe.arms.stiffness_per_s2
    damped = math.sqrt(k - b * b / 4)
    contact_s = math.atan2(b * damped, b * b / 2 - k) / damped
    rebound = speed_m_s * math.exp(-b / 2 * contact_s)
    peak_s = math.atan2(damped, b / 2) / damped
    fold_m = speed_m_s / damped * math.exp(-b / 2 * peak_s) * math.sin(damped * peak_s)
    return rebound, contact_s, fold_m
