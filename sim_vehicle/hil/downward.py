"""What looks down, for indoor flight without GPS or cameras: optical flow and a range finder."""

import random

import numpy as np
import numpy.typing as npt

from sim_vehicle.airframe import Airframe
from sim_vehicle.estimator.optics import distance_below
from sim_vehicle.estimator.samples import FlowSample, RangeSample
from sim_vehicle.estimator.sensors import FlowSensor, RangeSensor
from sim_vehicle.physics.rotation import matrix_from_quaternion

Floats = npt.NDArray[np.float64]


class DownwardSensors:
    """Those that the airframe is fitted with, at their rates, with their noise, range and losses.

    A sample goes out at the moment that it shows; PX4 is told so (EKF2_OF_DELAY and EKF2_RNG_DELAY of 0).
    """

    def __init__(self, airframe: Airframe, faces: Floats, interval_us: int, rng: random.Random) -> None:
        """``faces``: ground and obstacles as the optics see them (see `World`)."""
        sensors = airframe.sensors
        self._flow = FlowSensor(sensors.optical_flow, faces, interval_us, rng) if sensors.optical_flow.fitted else None
        self._range = RangeSensor(sensors.range_finder, interval_us, rng) if sensors.range_finder.fitted else None
        self._rotation = np.empty((3, 3))

    def observe(self, time_us: int, body: Floats, faces: Floats) -> list[FlowSample | RangeSample]:
        """See one interval of the true body; the samples that are due."""
        samples: list[FlowSample | RangeSample] = []
        if self._flow is not None:
            self._flow.look_at(faces)
            flow = self._flow.observe(time_us, body)
            if flow is not None:
                samples.append(flow)
        if self._range is not None and self._range.is_due(time_us):
            matrix_from_quaternion(body, self._rotation)
            samples.append(self._range.observe(time_us, distance_below(body, self._rotation, faces)))
        return samples
