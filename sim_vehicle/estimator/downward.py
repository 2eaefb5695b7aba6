"""What looks down, for flight without GPS or cameras: optical flow and a range finder."""

import random

import numpy as np
import numpy.typing as npt

from sim_vehicle.aiding import Sensors
from sim_vehicle.estimator.optics import distance_below
from sim_vehicle.estimator.samples import FlowSample, RangeSample
from sim_vehicle.estimator.sensors import FlowSensor, RangeSensor
from sim_vehicle.physics.rotation import matrix_from_quaternion

Floats = npt.NDArray[np.float64]


class DownwardSensors:
    """Those that the airframe is fitted with, at their rates, with their noise, range and losses.

    A sample comes at the moment that it shows. A filter of our own fuses it later, as late as the airframe says; PX4 is
    told that it is not late (EKF2_OF_DELAY and EKF2_RNG_DELAY of 0).
    """

    def __init__(self, sensors: Sensors, faces: Floats, interval_us: int, rng: random.Random) -> None:
        """``faces``: ground and obstacles as the optics see them (see `World`)."""
        self._sensors = sensors
        self._flow = FlowSensor(sensors.optical_flow, faces, interval_us, rng)
        self._range = RangeSensor(sensors.range_finder, interval_us, rng)
        self._rotation = np.empty((3, 3))
        self.look_at(faces)

    def look_at(self, faces: Floats) -> None:
        """See another world from now on."""
        self._faces = faces
        self._flow.look_at(faces)

    def observe(self, time_us: int, body: Floats) -> list[FlowSample | RangeSample]:
        """See one interval of the true body; the samples that are due."""
        samples: list[FlowSample | RangeSample] = []
        if self._sensors.optical_flow.fitted:
            flow = self._flow.observe(time_us, body)
            if flow is not None:
                samples.append(flow)
        if self._sensors.range_finder.fitted and self._range.is_due(time_us):
            matrix_from_quaternion(body, self._rotation)
            samples.append(self._range.observe(time_us, distance_below(body, self._rotation, self._faces)))
        return samples
