"""A single hit by which an arm is measured: the level vehicle thrown square at a wall, motors off."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim_vehicle.airframe import Airframe
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit

Floats = npt.NDArray[np.float64]

# The wall is far above the ground and met at once, so that the fall counts for nothing.
HEIGHT_M, GAP_M, AFTER_S = 5.0, 0.02, 0.35


@dataclass(frozen=True, slots=True)
class HeadOnHit:
    """What eq. 2 and the stop of the arms alone make of a hit, without drag and friction."""

    hit: Hit
    time_s: Floats
    """Since the first touch."""
    fold_m: Floats
    """Of the arm that folds the most."""
    speed_m_s: Floats
    """Into the wall."""


def head_on(airframe: Airframe, speed_m_s: float) -> HeadOnHit:
    """Throw the vehicle at a wall and follow it for `AFTER_S`. Without friction, as the falling vehicle would turn."""
    data = airframe.model_dump()
    data["drag_n_s_m"] = 0.0
    data["surface"]["guard_friction"] = 0.0
    wall = {"point_ned_m": [0, 0, -HEIGHT_M], "normal_ned": [-1, 0, 0]}
    plant = Plant(Airframe.model_validate(data), Scene.model_validate({"walls": [wall]}), seed=1)
    geometry = airframe.geometry
    touch_m = geometry.motor_radius_m / math.sqrt(2.0) + geometry.guard_radius_m
    plant.place((-touch_m - GAP_M, 0.0, -HEIGHT_M), (speed_m_s, 0.0, 0.0))
    for _ in range(round((GAP_M / speed_m_s + AFTER_S) * 1e6 / plant.interval_us)):
        plant.step(None, armed=False)
    hit, series = plant.truth.hits[0], plant.truth.series()
    time_s = 1e-6 * (series["time_boot_us"] - hit.contact_at_boot_us)
    return HeadOnHit(hit, time_s, series["arm_fold_m"].max(axis=1), series["velocity_ned_m_s"][:, 0])
