"""Aiding sensors: the truth in, samples with their rate, noise and range out."""

import math
import random
from abc import ABC, abstractmethod
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
    Sample,
)
from sim_vehicle.physics.rotation import matrix_from_quaternion, turn, yaw_of
from sim_vehicle.quantities import Floats, Vector3

AidType = TypeVar("AidType", bound=Aid)
SampleType = TypeVar("SampleType", bound=Sample)


class Sensor(ABC, Generic[AidType, SampleType]):
    """Sees every interval, and has a sample at its rate.

    A sample comes at the moment that it shows. A filter of our own fuses it later, as late as the airframe says; PX4 is
    told that it is not late (EKF2_OF_DELAY and EKF2_RNG_DELAY of 0).
    """

    def __init__(self, spec: AidType, interval_us: int, rng: random.Random) -> None:
        self.spec, self._rng = spec, rng
        self._interval_us, self._period_us = interval_us, round(1e6 / spec.rate_hz)

    def observe(self, time_us: int, body: Floats, faces: Floats) -> SampleType | None:
        """The sample, if the interval that has just ended contains a multiple of the period.

        ``body`` is the true one, ``faces`` are ground and obstacles as the optics see them (see `World`).
        """
        return self.sample(time_us, body, faces) if time_us % self._period_us < self._interval_us else None

    @abstractmethod
    def sample(self, time_us: int, body: Floats, faces: Floats) -> SampleType:
        """One of this moment."""

    def noise(self, deviation: float) -> Vector3:
        """One error an axis."""
        gauss = self._rng.gauss
        return gauss(0, deviation), gauss(0, deviation), gauss(0, deviation)


class FlowSensor(Sensor[OpticalFlow, FlowSample]):
    """A PX4FLOW: integrates flow and its own gyroscope between samples; what is not seen has quality 0."""

    def __init__(self, spec: OpticalFlow, interval_us: int, rng: random.Random) -> None:
        super().__init__(spec, interval_us, rng)
        self._step_s = 1e-6 * interval_us
        self._camera = np.zeros(optics.CAMERA_ROWS)
        self._last_us = 0

    def observe(self, time_us: int, body: Floats, faces: Floats) -> FlowSample | None:
        optics.watch(body, faces, self._step_s, self._camera)
        return super().observe(time_us, body, faces)

    def sample(self, time_us: int, body: Floats, faces: Floats) -> FlowSample:
        seen: list[float] = self._camera.tolist()
        self._camera[optics.FLOW_X : optics.TURN_Z + 1] = 0.0
        self._camera[optics.FASTEST] = 0.0
        integration_us, self._last_us = time_us - self._last_us, time_us
        if not self._sees(seen):
            return FlowSample(time_us, integration_us, (0.0, 0.0), (0.0, 0.0, 0.0), NO_QUALITY)
        spec, gauss, seconds = self.spec, self._rng.gauss, 1e-6 * integration_us
        turn_x, turn_y, turn_z = (
            seen[optics.TURN_X + axis] + gauss(0, spec.gyroscope_noise_rad_s * seconds) for axis in range(3)
        )
        flow_x = seen[optics.FLOW_X] + seen[optics.TURN_X] + gauss(0, spec.noise_rad_s * seconds)
        flow_y = seen[optics.FLOW_Y] + seen[optics.TURN_X + 1] + gauss(0, spec.noise_rad_s * seconds)
        return FlowSample(time_us, integration_us, (flow_x, flow_y), (turn_x, turn_y, turn_z), BEST_QUALITY)

    def _sees(self, seen: list[float]) -> bool:
        """Sharp enough to compare pictures, and slow enough that they still overlap."""
        spec = self.spec
        return (
            spec.distance_min_m <= seen[optics.DISTANCE] <= spec.distance_max_m
            and seen[optics.FASTEST] <= spec.rate_max_rad_s
        )


class RangeSensor(Sensor[RangeFinder, RangeSample]):
    """A LeddarOne that looks along the body's down axis."""

    def __init__(self, spec: RangeFinder, interval_us: int, rng: random.Random) -> None:
        super().__init__(spec, interval_us, rng)
        self._bias_m = rng.gauss(0, spec.bias_m)
        self._rotation = np.empty((3, 3))

    def sample(self, time_us: int, body: Floats, faces: Floats) -> RangeSample:
        matrix_from_quaternion(body, self._rotation)
        distance_m = optics.distance_below(body, self._rotation, faces)
        least_m, most_m = self.spec.distance_min_m, self.spec.distance_max_m
        if not least_m <= distance_m <= most_m:
            return RangeSample(time_us, None, least_m, most_m)
        measured_m = distance_m + self._bias_m + self._rng.gauss(0, self.spec.noise_m)
        return RangeSample(time_us, max(measured_m, 0.0), least_m, most_m)


class CompassSensor(Sensor[Compass, HeadingSample]):
    """A magnetometer already turned into a heading. A constant error would only rename north."""

    def sample(self, time_us: int, body: Floats, faces: Floats) -> HeadingSample:
        return HeadingSample(time_us, yaw_of(body) + self._rng.gauss(0, self.spec.noise_rad))


class CaptureSensor(Sensor[MotionCapture, CaptureSample]):
    """Cameras around the room: position and attitude, with errors that are new in every frame."""

    def sample(self, time_us: int, body: Floats, faces: Floats) -> CaptureSample:
        spec, seen = self.spec, body[:10].copy()
        seen[0:3] += self.noise(spec.noise_m)
        turn(body, *self.noise(spec.noise_rad), seen)
        x, y, z, _, _, _, qw, qx, qy, qz = seen.tolist()
        return CaptureSample(time_us, (x, y, z), (qw, qx, qy, qz), spec.noise_m, spec.noise_rad)


def downward_sensors(sensors: Sensors, interval_us: int, rng: random.Random) -> list[FlowSensor | RangeSensor]:
    """Those that look down and that the airframe is fitted with."""
    made = FlowSensor(sensors.optical_flow, interval_us, rng), RangeSensor(sensors.range_finder, interval_us, rng)
    return [sensor for sensor in made if sensor.spec.fitted]


def wrapped(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2 * math.pi) - math.pi
