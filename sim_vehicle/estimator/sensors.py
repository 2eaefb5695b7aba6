"""Aiding sensors: the truth in, samples with their rate, noise and range out."""

import math
import random
from typing import Generic, TypeVar

import numpy as np

from sim_vehicle.airframes.aiding import Aid, Compass, MotionCapture, OpticalFlow, RangeFinder, Sensors
from sim_vehicle.estimator import optics
from sim_vehicle.estimator.samples import (
    BEST_QUALITY,
    NO_QUALITY,
    CaptureSample,
    FlowSample,
    HeadingSample,
    RangeSample,
)
from sim_vehicle.physics.rotation import matrix_from_quaternion, yaw_of
from sim_vehicle.quantities import Floats

AidType = TypeVar("AidType", bound=Aid)


class Sensor(Generic[AidType]):
    """When its samples are due."""

    def __init__(self, spec: AidType, interval_us: int, rng: random.Random) -> None:
        self._spec, self._rng = spec, rng
        self._interval_us, self._period_us = interval_us, round(1e6 / spec.rate_hz)

    def is_due(self, time_us: int) -> bool:
        """Whether the interval just ended contains a multiple of the period."""
        return time_us % self._period_us < self._interval_us


class FlowSensor(Sensor[OpticalFlow]):
    """A PX4FLOW: integrates flow and its own gyroscope between samples; what is not seen has quality 0."""

    def __init__(self, spec: OpticalFlow, interval_us: int, rng: random.Random) -> None:
        super().__init__(spec, interval_us, rng)
        self._step_s = 1e-6 * interval_us
        self._camera = np.zeros(optics.CAMERA_ROWS)
        self._last_us = 0

    def observe(self, time_us: int, body: Floats, faces: Floats) -> FlowSample | None:
        """See one interval; the sample if one is due."""
        optics.watch(body, faces, self._step_s, self._camera)
        if not self.is_due(time_us):
            return None
        seen: list[float] = self._camera.tolist()
        self._camera[optics.FLOW_X : optics.TURN_Z + 1] = 0.0
        self._camera[optics.FASTEST] = 0.0
        integration_us, self._last_us = time_us - self._last_us, time_us
        if not self._sees(seen):
            return FlowSample(time_us, integration_us, (0.0, 0.0), (0.0, 0.0, 0.0), NO_QUALITY)
        spec, gauss, seconds = self._spec, self._rng.gauss, 1e-6 * integration_us
        turn_x, turn_y, turn_z = (
            seen[optics.TURN_X + axis] + gauss(0, spec.gyroscope_noise_rad_s * seconds) for axis in range(3)
        )
        flow_x = seen[optics.FLOW_X] + seen[optics.TURN_X] + gauss(0, spec.noise_rad_s * seconds)
        flow_y = seen[optics.FLOW_Y] + seen[optics.TURN_X + 1] + gauss(0, spec.noise_rad_s * seconds)
        return FlowSample(time_us, integration_us, (flow_x, flow_y), (turn_x, turn_y, turn_z), BEST_QUALITY)

    def _sees(self, seen: list[float]) -> bool:
        """Sharp enough to compare pictures, and slow enough that they still overlap."""
        spec = self._spec
        return (
            spec.distance_min_m <= seen[optics.DISTANCE] <= spec.distance_max_m
            and seen[optics.FASTEST] <= spec.rate_max_rad_s
        )


class RangeSensor(Sensor[RangeFinder]):
    """A LeddarOne that looks along the body's down axis."""

    def __init__(self, spec: RangeFinder, interval_us: int, rng: random.Random) -> None:
        super().__init__(spec, interval_us, rng)
        self._bias_m = rng.gauss(0, spec.bias_m)

    def observe(self, time_us: int, distance_m: float) -> RangeSample:
        """The sample of a true distance, which is only worth computing when one is due."""
        spec = self._spec
        least_m, most_m = spec.distance_min_m, spec.distance_max_m
        if not least_m <= distance_m <= most_m:
            return RangeSample(time_us, None, least_m, most_m)
        measured_m = distance_m + self._bias_m + self._rng.gauss(0, spec.noise_m)
        return RangeSample(time_us, max(measured_m, 0.0), least_m, most_m)


class DownwardSensors:
    """Those that the airframe is fitted with, at their rates, with their noise and range.

    A sample comes at the moment that it shows. A filter of our own fuses it later, as late as the airframe says; PX4 is
    told that it is not late (EKF2_OF_DELAY and EKF2_RNG_DELAY of 0).
    """

    def __init__(self, sensors: Sensors, interval_us: int, rng: random.Random) -> None:
        self._sensors = sensors
        self._flow = FlowSensor(sensors.optical_flow, interval_us, rng)
        self._range = RangeSensor(sensors.range_finder, interval_us, rng)
        self._rotation = np.empty((3, 3))

    def observe(self, time_us: int, body: Floats, faces: Floats) -> list[FlowSample | RangeSample]:
        """See one interval of the true body over ``faces``, ground and obstacles as the optics see them (see `World`);
        the samples that are due.
        """
        samples: list[FlowSample | RangeSample] = []
        if self._sensors.optical_flow.fitted:
            flow = self._flow.observe(time_us, body, faces)
            if flow is not None:
                samples.append(flow)
        if self._sensors.range_finder.fitted and self._range.is_due(time_us):
            matrix_from_quaternion(body, self._rotation)
            samples.append(self._range.observe(time_us, optics.distance_below(body, self._rotation, faces)))
        return samples


class CompassSensor(Sensor[Compass]):
    """A magnetometer already turned into a heading. A constant error would only rename north."""

    def observe(self, time_us: int, body: Floats) -> HeadingSample | None:
        """The sample if one is due."""
        if not self.is_due(time_us):
            return None
        return HeadingSample(time_us, yaw_of(body) + self._rng.gauss(0, self._spec.noise_rad))


class CaptureSensor(Sensor[MotionCapture]):
    """Cameras around the room: position and heading, with errors that are new in every frame."""

    def observe(self, time_us: int, body: Floats) -> CaptureSample | None:
        """The sample if one is due."""
        if not self.is_due(time_us):
            return None
        gauss, noise_m = self._rng.gauss, self._spec.noise_m
        x, y, z = body[0:3].tolist()
        position = (x + gauss(0, noise_m), y + gauss(0, noise_m), z + gauss(0, noise_m))
        return CaptureSample(time_us, position, yaw_of(body) + gauss(0, self._spec.noise_rad))


def wrapped(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2 * math.pi) - math.pi
