"""The estimator as it runs on the vehicle: sensors, the filter at its delayed horizon, the output predictor.

And whether the vehicle stands still, from its own motors' state and its inertial sensor.
"""

import math
import random
from collections import deque
from enum import Enum, auto
from typing import Any

import numpy as np

from sim_vehicle.airframe import Airframe
from sim_vehicle.estimator import strapdown
from sim_vehicle.estimator.estimate import yaw_of
from sim_vehicle.estimator.filter import NavigationFilter
from sim_vehicle.estimator.samples import NO_QUALITY, CaptureSample, FlowSample, RangeSample, Sample
from sim_vehicle.estimator.sensors import CaptureSensor, CompassSensor, Sensor, downward_sensors
from sim_vehicle.estimator.strapdown import FORCE, RATES
from sim_vehicle.physics.estimate import SLOPE_TIME_CONSTANT_S
from sim_vehicle.physics.layout import GRAVITY_M_S2
from sim_vehicle.physics.record import new_record
from sim_vehicle.quantities import Floats

# Still for as long as this, and the rates of this long are averaged: their noise is down to a fifth.
WINDOW_S = 0.1
# Six standard deviations of one sample's noise (0.25 m/s^2, 0.01 rad/s) and the biases' share.
STILL_FORCE_M_S2 = 1.5
STILL_RATE_RAD_S = 0.1
# Feet are soft: what is left of a touchdown when the sensor no longer shows it.
STILL_SPEED_M_S = 0.02


class RestDetector:
    """Collects windows in which nothing moved while the motors did not fly."""

    def __init__(self, interval_us: int) -> None:
        self.window = max(round(1e6 * WINDOW_S / interval_us), 1)
        """How many samples a mean is made of."""
        self._count = 0
        self._sum = np.zeros(3)

    def update(self, sample: Floats, flies: bool) -> Floats | None:
        """Take one inertial sample; the mean rates of the window that it completes, if any."""
        if flies:
            self._count = 0
            return None
        x, y, z, p, q, r = sample[FORCE : RATES + 3].tolist()
        force = (x * x + y * y + z * z) ** 0.5
        if abs(force - GRAVITY_M_S2) > STILL_FORCE_M_S2 or p * p + q * q + r * r > STILL_RATE_RAD_S**2:
            self._count = 0
            return None
        if self._count == 0:
            self._sum[:] = 0.0
        self._sum += sample[RATES : RATES + 3]
        self._count += 1
        if self._count < self.window:
            return None
        self._count = 0
        return self._sum / self.window


# So that the sensors' noise does not change with what the rest of the simulation draws.
_OWN_SEED = 0xF10
# After a position reset by motion capture: the speed by which the vehicle went astray unseen.
_SPEED_AFTER_RESET_M_S = 1.0


class _Aided(Enum):
    """What can be lost and found."""

    VELOCITY = auto()
    HEIGHT = auto()
    POSITION = auto()


class OnboardEstimator:
    """Sensors and filter of one flight; everything in it that is not a sensor knows samples only."""

    def __init__(self, airframe: Airframe, body: Floats, seed: int) -> None:
        """``body`` is the true state at the start, of which the vehicle knows where its frame begins."""
        sensors, interval_us = airframe.sensors, airframe.imu.integration_interval_us
        rng = random.Random(seed ^ _OWN_SEED)
        self._airframe = airframe
        self._interval_us = interval_us
        self._step_s = 1e-6 * interval_us
        self._sensors: list[Sensor[Any, Any]] = [*downward_sensors(sensors, interval_us, rng)]
        if sensors.compass.fitted:
            self._sensors.append(CompassSensor(sensors.compass, interval_us, rng))
        if sensors.motion_capture.fitted:
            self._sensors.append(CaptureSensor(sensors.motion_capture, interval_us, rng))
        self._has_cameras = sensors.motion_capture.fitted
        self._rest = RestDetector(interval_us)
        # At least one sample behind, so that the output predictor always has one to go by.
        self._slots = max(math.ceil(sensors.delay_s / self._step_s - 1e-9), 1) + 1
        self._share = 1 - math.exp(-self._step_s / SLOPE_TIME_CONSTANT_S)
        self._clipped = np.zeros(3)
        self.flow: FlowSample | None = None
        self.range: RangeSample | None = None
        self.reset_counter = 0
        self._seed_yaw_noise = rng.gauss(0, 1)
        self.start(body, 0)

    def start(self, body: Floats, time_us: int) -> None:
        """Begin anew, at a place, speed and tilt that are known and with the heading that the sensors show."""
        sensors = self._airframe.sensors
        heads_by = sensors.motion_capture if self._has_cameras else sensors.compass
        half_rad = heads_by.noise_rad * self._seed_yaw_noise / 2
        cos, sin = math.cos(half_rad), math.sin(half_rad)
        px, py, pz, vx, vy, vz, w, x, y, z = body[0:10].tolist()
        attitude_wxyz = (cos * w - sin * z, cos * x - sin * y, cos * y + sin * x, cos * z + sin * w)
        self.filter = NavigationFilter(self._airframe, (px, py, pz), (vx, vy, vz), attitude_wxyz)
        self._samples = np.zeros((self._slots, strapdown.SAMPLE_COLUMNS))
        self._samples[:, strapdown.FORCE + 2] = -GRAVITY_M_S2
        self._head = 0
        self._output = new_record(strapdown.Output, now=[*self.filter.nominal, 0.0, 0.0, 0.0])
        self._past = np.tile(self.filter.nominal[: strapdown.GYROSCOPE_BIAS], (self._slots, 1))
        self._waiting: deque[Sample] = deque()
        self._fused_us = dict.fromkeys(_Aided, time_us)

    def update(
        self,
        time_us: int,
        sensed: Floats,
        flies: bool,
        body: Floats,
        faces: Floats,
        estimate: Floats,
        acceleration_ned_m_s2: Floats,
    ) -> None:
        """Take one inertial sample; renew ``estimate`` (position, velocity, attitude) and the acceleration.

        ``sensed`` (SAMPLE_COLUMNS,): the sample, with the clipped raw samples counted since boot. ``body`` and
        ``faces``, the truth, go no further than the sensors.
        """
        self._sense(time_us, body, faces)
        resets = self.reset_counter
        head = self._head = (self._head + 1) % self._slots
        strapdown.keep_sample(self._samples, head, sensed, self._clipped)
        oldest = (head + 1) % self._slots
        self.filter.predict(self._samples[oldest])
        horizon_us = time_us - (self._slots - 1) * self._interval_us
        self._fuse_rest(self._samples[oldest], flies, horizon_us)
        while self._waiting and self._waiting[0].time_us <= horizon_us:
            self._fuse(self._waiting.popleft())
        nominal, past, output = self.filter.nominal, self._past, self._output
        strapdown.follow(nominal, self._samples, past, oldest, self._step_s, output)
        if self.reset_counter != resets:
            strapdown.jump(nominal, past, oldest, output)
        strapdown.show(output.now, self._share, estimate, acceleration_ned_m_s2)

    def variances(self) -> tuple[float, float, float]:
        """Of position (m2), velocity (m2/s2) and attitude (rad2), each on its worst axis."""
        diagonal: list[float] = self.filter.covariance.diagonal().tolist()
        position, velocity, attitude = (
            diagonal[row : row + 3] for row in (strapdown.D_POSITION, strapdown.D_VELOCITY, strapdown.D_ATTITUDE)
        )
        return max(position), max(velocity), max(attitude)

    # --- sensing: the only place that looks at the truth ----------------------------------------------------

    def _sense(self, time_us: int, body: Floats, faces: Floats) -> None:
        for sensor in self._sensors:
            sample = sensor.observe(time_us, body, faces)
            if sample is None:
                continue
            if isinstance(sample, FlowSample):
                self.flow = sample
            elif isinstance(sample, RangeSample):
                self.range = sample
            self._waiting.append(sample)

    # --- fusing ---------------------------------------------------------------------------------------------

    def _fuse(self, sample: Sample) -> None:
        if isinstance(sample, FlowSample):
            self._fuse_flow(sample)
            self.filter.begin_flow()
        elif isinstance(sample, CaptureSample):
            self._fuse_capture(sample)
        elif self._has_cameras:
            # Height and heading come from one reference, as in PX4: a beam's offset would argue with the cameras.
            return
        elif isinstance(sample, RangeSample):
            self._fuse_range(sample)
        else:
            compass, gate = self._airframe.sensors.compass, self._airframe.estimator.heading_gate
            self.filter.fuse_heading(sample.yaw_rad, compass.noise_rad, gate)

    def _fuse_flow(self, sample: FlowSample) -> None:
        if sample.quality == NO_QUALITY:
            return
        spec, seconds = self._airframe.sensors.optical_flow, 1e-6 * sample.integration_us
        flow_rad = (
            sample.flow_frd_rad[0] - sample.gyroscope_frd_rad[0],
            sample.flow_frd_rad[1] - sample.gyroscope_frd_rad[1],
        )
        noise_rad = math.hypot(spec.noise_rad_s, spec.gyroscope_noise_rad_s) * seconds
        if self._is_lost(_Aided.VELOCITY, sample.time_us):
            self.filter.reset_horizontal_velocity(flow_rad, seconds, noise_rad)
            self.reset_counter += 1
        elif not self.filter.fuse_flow(flow_rad, noise_rad, self._airframe.estimator.flow_gate):
            return
        self._fused_us[_Aided.VELOCITY] = sample.time_us

    def _fuse_range(self, sample: RangeSample) -> None:
        if sample.distance_m is None:
            return
        noise_m, gate = self._airframe.sensors.range_finder.noise_m, self._airframe.estimator.range_gate
        if not self.filter.fuse_range(sample.distance_m, noise_m, gate):
            if not self._is_lost(_Aided.HEIGHT, sample.time_us):
                return
            self.filter.forget_height()
            self.filter.fuse_range(sample.distance_m, noise_m, math.inf)
            self.reset_counter += 1
        self._fused_us[_Aided.HEIGHT] = sample.time_us

    def _fuse_capture(self, sample: CaptureSample) -> None:
        tuning = self._airframe.estimator
        if not self.filter.fuse_position(sample.position_ned_m, sample.noise_m, tuning.capture_gate):
            if not self._is_lost(_Aided.POSITION, sample.time_us):
                return
            self.filter.forget_position(_SPEED_AFTER_RESET_M_S)
            self.filter.fuse_position(sample.position_ned_m, sample.noise_m, math.inf)
            self.reset_counter += 1
        self.filter.fuse_heading(yaw_of(sample.attitude_wxyz), sample.noise_rad, tuning.heading_gate)
        self._fused_us[_Aided.POSITION] = sample.time_us
        self._fused_us[_Aided.VELOCITY] = sample.time_us

    def _is_lost(self, what: _Aided, now_us: int) -> bool:
        """Whether nothing was fused for so long that the next good sample resets what it measures.

        PX4 does the same (EKF2's `no_aid_timeout_max`, optical_flow_control.cpp) and counts each reset in
        ODOMETRY.reset_counter, so that whoever flies by the estimate knows that it has jumped.
        """
        return now_us - self._fused_us[what] > round(1e6 * self._airframe.estimator.reset_after_s)

    def _fuse_rest(self, sample: Floats, flies: bool, horizon_us: int) -> None:
        mean_rates = self._rest.update(sample, flies)
        if mean_rates is None:
            return
        noise_rad_s = self._airframe.imu.gyroscope_noise_rad_s / math.sqrt(self._rest.window)
        self.filter.fuse_rest(mean_rates, STILL_SPEED_M_S, noise_rad_s)
        self._fused_us[_Aided.VELOCITY] = horizon_us
