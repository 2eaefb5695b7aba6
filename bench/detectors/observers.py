"""Detectors by a model: `momentum` and `hybrid` observe an external force, `tracking` a path that is not kept."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from bench.detectors.contact import Baseline, BaselineState, Reading
from companion.messages import ImuSample, LocalPosition, MessageId, Sample, Vector3
from companion.motion.config import GRAVITY_M_S2
from companion.motion.rotation import body_to_ned, ned_to_body
from companion.motion.vector import ZERO, along, minus, plus, towards
from companion.reflex.detection.detector import Impact, Motion, Phase, Situation

# Drag changes within a second; the model's error in seconds. So does the lag behind a setpoint, with the speed.
MEAN_MEMORY_S = 1.0


def _size(vector: Vector3) -> float:
    return math.sqrt(along(vector, vector))


# --- `momentum`

# Velocities further apart leave the observer on its own for too long.
LONGEST_STEP_S = 0.25
# 50 ms: a contact of 20 to 120 ms is followed, and velocities at 50 Hz carry it.
GAIN_PER_S = 20.0


@dataclass(slots=True)
class MomentumState(BaselineState):
    """Adds the observer. NED per unit mass; changed in place."""

    imu_boot_us: int = 0
    velocity_boot_us: int | None = None
    integral_m_s: Vector3 = ZERO
    mean_m_s2: Vector3 = ZERO
    residual_m_s2: Vector3 = ZERO


class MomentumDetector(Baseline):
    """Detector `momentum`: external force by a generalised-momentum observer.

    After F. Ruggiero et al., "Passivity-based control of VToL UAVs with a momentum-based estimator of external
    wrench and unmodeled dynamics" (Robotics and Autonomous Systems 72, 2015), and A. De Luca's residual for robot
    arms. Of the momentum p = m v the known part is thrust and gravity, so with a gain K (1/s) the residual

        r = K [ p - integral of (m g e3 - T R e3 + r) dt ]      which obeys      r' = K (F_ext - r)

    is the external force, low-passed. Per unit mass m cancels: v is the vehicle's velocity estimate and T / m comes
    from ATTITUDE_TARGET.thrust, with the gain learnt in flight (see `free_flight`). The sample's force must depart
    from its running mean (drag, and the model's error) by the threshold. Nothing of the accelerometer's short peaks
    is used: it is as late as the velocity and 1 / K.

    Checked: residual, signs and first-order law are those of the observer in LAAS-CNRS's phynt-genom3 (there of the
    angular momentum, the known forces being torques), read as program. The article's text was not at hand: whether
    its estimator is of a higher order than one was not checked. Gain, threshold, running mean and the learnt thrust
    are this project's.
    """

    name, state, looks_at = "momentum", MomentumState, LocalPosition
    losses: ClassVar[Mapping[MessageId, str]] = {
        MessageId.ATTITUDE_TARGET: "thrust is taken for the accelerometer's mean, so that manoeuvres look like pushes"
    }

    def step(self, state: MomentumState, sample: Sample, situation: Situation, motion: Motion) -> Impact | None:
        if isinstance(sample, ImuSample):
            elapsed_s = min(max(sample.time_boot_us - state.imu_boot_us, 0), 50_000) * 1e-6
            state.imu_boot_us = sample.time_boot_us
            state.thrust.learn(sample.time_boot_us, -sample.specific_force_frd_m_s2[2], elapsed_s)
        return super().step(state, sample, situation, motion)

    def look(self, s: MomentumState, sample: LocalPosition, situation: Situation) -> Reading | None:
        """One step of the observer with one velocity."""
        now_us, velocity, before_us = sample.time_boot_us, sample.velocity_ned_m_s, s.velocity_boot_us
        s.velocity_boot_us = now_us
        dt_s = 0.0 if before_us is None else (now_us - before_us) * 1e-6
        if not 0.0 < dt_s < LONGEST_STEP_S:
            s.integral_m_s, s.residual_m_s2, s.mean_m_s2 = velocity, ZERO, ZERO
            return None
        lift = s.thrust.expected_m_s2(now_us, -GRAVITY_M_S2)
        known = plus(body_to_ned(s.attitude_wxyz, (0.0, 0.0, lift)), GRAVITY_M_S2, (0.0, 0.0, 1.0))
        s.integral_m_s = plus(s.integral_m_s, dt_s, plus(known, 1.0, s.residual_m_s2))
        s.residual_m_s2 = plus(ZERO, GAIN_PER_S, minus(velocity, s.integral_m_s))
        push = minus(s.residual_m_s2, s.mean_m_s2)
        size = _size(push)
        is_loud = size >= s.threshold_m_s2
        if not is_loud:
            s.mean_m_s2 = plus(s.mean_m_s2, dt_s / MEAN_MEMORY_S, push)
        free_until_us = now_us - round(1e6 / GAIN_PER_S) - round(2e6 * dt_s)
        return Reading(is_loud, ned_to_body(s.attitude_wxyz, push), size, free_until_us)


# --- `hybrid`

# A contact's first sample shows 70 % of itself at 250 Hz, all of it at 50 Hz.
FORCE_GAIN_PER_S = 300.0
# Wind: what is slower than 2 Hz.
WIND_GAIN_PER_S = 12.0
# Motors at full moment make 200 rad/s^2; nothing that flies by itself needs more.
TORQUE_THRESHOLD_RAD_S2, TORQUE_GAIN_PER_S = 400.0, 100.0


@dataclass(slots=True)
class HybridState(BaselineState):
    """Adds the observers; body FRD, changed in place."""

    force_m_s2: Vector3 = ZERO
    wind_m_s2: Vector3 = ZERO
    rates_rad_s: Vector3 | None = None
    turning_rad_s2: Vector3 = ZERO


class HybridDetector(Baseline):
    """Detector `hybrid`: force by the accelerometer, torque by the angular momentum.

    After T. Tomic, C. Ott and S. Haddadin, "External Wrench Estimation, Collision Detection, and Reflex Reaction for
    Flying Robots" (IEEE Transactions on Robotics 33(6), 2017). The force needs no velocity,

        F_ext / m = f - T / m                  low-passed at the gain K_f: F' = K_f (f - T / m - F),

    the torque is the residual of the angular momentum J w with the commanded moment tau,

        r = K_t [ J w - integral of (tau + J w x w + r) dt ].

    A collision is what is faster than wind: the force's departure from its own low-pass must exceed a threshold.
    MAVLink does not tell tau; what the controllers can ask for is inside the torque's threshold instead. Of J only
    its ratio to the torque matters: r is kept as an angular acceleration, rad/s^2; the gyroscopic term, small
    beside a hit, is left out.

    Checked: both equations, signs included, are those of LAAS-CNRS's observer after this article (phynt-genom3),
    read as program; that one has the measured torques and the gyroscopic term, and decides on no collision. The
    article's text was not at hand: how it tells collisions from wind, its gains and its thresholds were not
    checked. Those here, and what is left out above, are this project's.
    """

    name, state = "hybrid", HybridState
    losses: ClassVar[Mapping[MessageId, str]] = {
        MessageId.ATTITUDE_TARGET: "the z axis is not watched, so pushes from above and below are not seen"
    }

    def look(self, s: HybridState, sample: ImuSample, situation: Situation) -> Reading:
        dt_s = min(max(sample.time_boot_us - s.last_sample_boot_us, 1), 50_000) * 1e-6
        push = self._force(s, sample, dt_s)
        size = _size(push)
        is_turned = self._torque(s, sample.angular_velocity_frd_rad_s, dt_s) >= TORQUE_THRESHOLD_RAD_S2
        free_until_us = self.free_until_us(s, sample.time_boot_us)
        return Reading(size >= s.threshold_m_s2 or is_turned, push, size, free_until_us)

    def _force(self, s: HybridState, sample: ImuSample, dt_s: float) -> Vector3:
        """The observer's step; the force beyond wind, m/s^2."""
        f_x, f_y, f_z = sample.specific_force_frd_m_s2
        s.thrust.learn(sample.time_boot_us, -f_z, dt_s)
        # Without a thrust to go by the observer sees none of the axis that it acts on.
        external = (f_x, f_y, f_z - s.thrust.expected_m_s2(sample.time_boot_us, f_z))
        s.force_m_s2 = _followed(s.force_m_s2, external, FORCE_GAIN_PER_S * dt_s)
        s.wind_m_s2 = _followed(s.wind_m_s2, external, WIND_GAIN_PER_S * dt_s)
        return minus(s.force_m_s2, s.wind_m_s2)

    def _torque(self, s: HybridState, rates: Vector3, dt_s: float) -> float:
        """The residual r' = K_t (w' - r); its size, rad/s^2."""
        x, y, z = minus(rates, s.rates_rad_s or rates)
        s.rates_rad_s = rates
        s.turning_rad_s2 = _followed(s.turning_rad_s2, (x / dt_s, y / dt_s, z / dt_s), TORQUE_GAIN_PER_S * dt_s)
        return _size(s.turning_rad_s2)


def _followed(old: Vector3, new: Vector3, gain: float) -> Vector3:
    """One step of a first-order low-pass: exact in time, so that no rate makes it unstable."""
    return towards(old, new, 1.0 - math.exp(-gain))


# --- `tracking`

# A setpoint that jumps further than this from one position to the next begins a new path.
JUMP_M = 0.5
# PX4 follows a setpoint that speeds up by 2 m/s^2 to 0.2 m; a good position is good to 0.01 m.
BOUND_M = 0.3


@dataclass(slots=True)
class TrackingState(BaselineState):
    """Adds the path's error; changed in place. `threshold_m_s2` stays 0: no force is looked at."""

    setpoint_ned_m: tuple[float, float, float] | None = None
    position_boot_us: int = 0
    mean_m: float = 0.0


class TrackingDetector(Baseline):
    """Detector `tracking`: a supervisor that takes a large error in following the path for a contact.

    After R. Naldi et al., "Robust 'blind' navigation for a miniature ducted-fan aerial robot" (American Control
    Conference, 2013), as the paper tells it: a supervisor detects a collision by a threshold on the error of the
    path-following controller. Here

        | p_setpoint(t) - p(t) | - its running mean   >= bound,

    the mean being the lag that every vehicle flies behind its setpoint with. It needs no accelerometer at all, and
    sees a hit only when the path has gone on without the vehicle: tenths of a second late; a hit on a vehicle that
    hovers only by how far it was thrown.

    Neither the article's text nor a program of its authors was at hand: which error they take (place, velocity,
    heading), and its bound, were not checked. The error of the place, the running mean and the bound are this
    project's.
    """

    name, state, looks_at = "tracking", TrackingState, LocalPosition

    def look(self, state: TrackingState, sample: LocalPosition, situation: Situation) -> Reading | None:
        asked, now_us = situation.setpoint_position_ned_m, sample.time_boot_us
        if asked is None:
            state.phase, state.off_reason = Phase.OFF, "no setpoint"
            return None
        last, state.setpoint_ned_m = state.setpoint_ned_m, asked
        behind = minus(sample.position_ned_m, asked)
        error_m = _size(behind)
        before_us, state.position_boot_us = state.position_boot_us, now_us
        if last is None or math.dist(last, asked) > JUMP_M:
            state.mean_m = error_m
        is_loud = error_m - state.mean_m >= BOUND_M
        if not is_loud:
            elapsed_s = min(max(now_us - before_us, 0) * 1e-6, MEAN_MEMORY_S)
            state.mean_m += elapsed_s / MEAN_MEMORY_S * (error_m - state.mean_m)
        # Thrown back from the setpoint with what it takes to be left behind this far in the time of the mean.
        force = ned_to_body(state.attitude_wxyz, behind)
        return Reading(is_loud, force, 0.0, before_us - round(1e6 * MEAN_MEMORY_S))
