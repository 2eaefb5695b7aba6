"""The collision monitor joins the detector, the impact estimate and the stream health. It is pure, and the same in
flight, replay and bench.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from pydantic import field_validator

from companion.messages import Attitude, AttitudeTarget, ImuSample, MessageId, Odometry, Refused, Sample, Vector3
from companion.motion.config import KEPT_US
from companion.motion.history import Lateness
from companion.reflex.config import EstimateConfig, FusedConfig, StreamHealthConfig
from companion.reflex.detection.detector import Detector, DetectorState, Phase, Situation
from companion.reflex.detection.fused import FusedDetector, FusedState
from companion.reflex.detection.health import Promise, SampleGate, StreamHealth, promise_of
from companion.reflex.detection.impact import ImpactEstimate, ImpactEstimator
from companion.strict_model import StrictModel

# Optional streams besides HIGHRES_IMU.
OPTIONAL_STREAMS: dict[type, MessageId] = {
    AttitudeTarget: MessageId.ATTITUDE_TARGET,
    Odometry: MessageId.ODOMETRY,
}


class CollisionMonitorConfig(StrictModel):
    """Settings of the collision monitor."""

    retired = frozenset({"fuzzy", "hybrid", "lateral", "momentum", "threshold", "tracking"})

    detectors: ClassVar[Mapping[str, Callable[[Any, int], Detector]]] = {FusedDetector.name: FusedDetector}
    """By the names allowed in `detector`, from their settings and the IMU's averaging interval in microseconds. A
    subclass adds others, with a key for the settings of each."""

    detector: str = "fused"
    """Its own settings are those under its name."""
    fused: FusedConfig = FusedConfig()
    sight: StreamHealthConfig = StreamHealthConfig()
    estimate: EstimateConfig = EstimateConfig()

    @field_validator("detector")
    @classmethod
    def _known_detector(cls, name: str) -> str:
        if name not in cls.detectors:
            choices = " or ".join(f"'{detector}'" for detector in sorted(cls.detectors))
            raise ValueError(f"there is no detector '{name}': a drone flies with {choices}")
        return name


@dataclass(frozen=True, slots=True)
class Notice:
    """An event of the timeline about the detector itself."""

    kind: str  # of the event
    text: str
    data: Mapping[str, float | str | Vector3] = field(default_factory=dict)


@dataclass(slots=True)
class CollisionMonitor:
    """The state between two steps, changed only by `advance`. It can be copied and pickled as a whole."""

    config: CollisionMonitorConfig
    detector: Detector
    state: DetectorState
    estimator: ImpactEstimator
    stream_health: StreamHealth
    no_data_reason: str | None = None  # why an armed detector could miss a hit; None while the streams are healthy
    gate: SampleGate = field(default_factory=SampleGate)
    lateness: Lateness = field(default_factory=Lateness)  # of the IMU's samples
    imu_fault: str | None = None  # what was wrong with the newest IMU message
    is_attitude_old: bool = False  # too old to integrate the accelerometer
    is_introduced: bool = False  # threshold and losses have been reported
    invalidity_reported: bool = False
    promise: Promise | None = None  # while it was last armed
    promised_us: int = 0
    heard: set[MessageId] = field(default_factory=set)

    @property
    def seen_from(self) -> str:
        """What a hit must be, in words."""
        if self.promise is not None and self.state.phase is Phase.ARMED:
            return self.promise.text()
        return f"{self.state.threshold_m_s2:.1f} m/s^2"

    def describe(self) -> str:
        """For the live line."""
        if self.no_data_reason is not None:
            return f"blind ({self.no_data_reason})"
        if self.state.phase is Phase.OFF:
            return f"off ({self.state.off_reason})"
        return f"{self.state.phase.value} at {self.seen_from}"


def start_monitor(config: CollisionMonitorConfig, now_us: int) -> CollisionMonitor:
    """A monitor before its first sample; ``now_us`` is on the clock of `advance`."""
    averaging_us = round(config.estimate.imu_averaging_interval_s * 1e6)
    detector = config.detectors[config.detector](getattr(config, config.detector), averaging_us)
    return CollisionMonitor(
        config, detector, detector.initial(), ImpactEstimator(config.estimate), StreamHealth(now_us)
    )


def advance(
    monitor: CollisionMonitor, samples: Sequence[Sample], situation: Situation, now_us: int
) -> tuple[list[ImpactEstimate], list[Notice]]:
    """Take the samples received since the last call, in order; call it without any, too: that shows a silence.

    Impacts at their first sample, and notices. The estimator refines the latest impact.
    """
    impacts: list[ImpactEstimate] = []
    imu_samples, is_on, sight, estimator = 0, situation.off_reason is None, monitor.config.sight, monitor.estimator
    if is_on and monitor.state.threshold_m_s2 > sight.max_threshold_m_s2:
        situation = situation._replace(off_reason=_vibration(monitor.state))
    for sample in samples:
        if type(sample) is ImuSample:
            if not monitor.gate.imu(sample):
                monitor.imu_fault = "IMU stuck at one value"
                continue
            monitor.imu_fault = None
            imu_samples += 1
            if monitor.lateness.is_late(sample.time_boot_us, estimator.strapdown.time_boot_us):
                continue
            sample = estimator.biases.given_back(sample, not estimator.followed)
        elif type(sample) is Attitude and not monitor.gate.attitude(sample):
            continue
        elif type(sample) is Refused:
            if sample.message == MessageId.HIGHRES_IMU.name:
                monitor.imu_fault = f"HIGHRES_IMU not accepted: {sample.reason}"
            continue
        elif type(sample) in OPTIONAL_STREAMS:
            monitor.heard.add(OPTIONAL_STREAMS[type(sample)])
        estimator.update(sample)
        attitude, newest_us = monitor.gate.latest, estimator.strapdown.time_boot_us
        monitor.is_attitude_old = attitude is not None and newest_us - attitude.time_boot_us > sight.silence_s * 1e6
        if monitor.is_attitude_old:
            estimator.strapdown.fixes.clear()
        impact = monitor.detector.step(monitor.state, sample, situation, estimator)
        if impact is not None:
            impacts.append(estimator.begin(impact))
        elif type(sample) is ImuSample and estimator.estimate is not None and not estimator.estimate.is_final:
            estimator.follow(sample, monitor.state)
    fault, state = monitor.stream_health.imu(imu_samples, sight, now_us), monitor.state
    if now_us - monitor.promised_us >= 1e6 and isinstance(state, FusedState) and state.phase is Phase.ARMED:
        imu_hz, counted = len(monitor.stream_health.arrivals_us), MessageId.ODOMETRY in monitor.heard
        monitor.promise = promise_of(state, monitor.config.fused, estimator.strapdown.fixes, imu_hz, counted)
        monitor.promised_us = now_us
    return impacts, _notices(monitor, is_on, fault, now_us)


def _vibration(state: DetectorState) -> str:
    """Why nothing but a crash is reported now: vibration has grown until only a crash would exceed the threshold."""
    return f"vibration hides hits below {state.threshold_m_s2:.0f} m/s^2"


def _notices(monitor: CollisionMonitor, is_on: bool, fault: str | None, now_us: int) -> list[Notice]:
    """Whether the detector sees while it is on, and whether the velocity is valid once the contact is over.

    Each when it changes; threshold and losses once. `fault`: what is wrong with the IMU's stream.
    """
    notices: list[Notice] = []
    sight, was, reason = monitor.config.sight, monitor.no_data_reason, None
    if is_on and fault is not None:
        reason = monitor.imu_fault or fault
    elif is_on and monitor.state.threshold_m_s2 > sight.max_threshold_m_s2:
        reason = _vibration(monitor.state)
    elif is_on and monitor.is_attitude_old:
        reason = f"no ATTITUDE_QUATERNION for {round(sight.silence_s * 1e3)} ms"
    monitor.no_data_reason = reason
    if (reason is None) != (was is None) and is_on:
        notices.append(Notice("link", "the detector sees again" if reason is None else f"detector blind: {reason}"))
    is_new = not monitor.is_introduced and monitor.state.phase is Phase.ARMED
    if is_new and now_us - monitor.stream_health.started_us >= KEPT_US:
        monitor.is_introduced = True
        text = f"detector '{monitor.detector.name}' armed: from {monitor.seen_from}"
        notices.append(Notice("detector", text, {"threshold_m_s2": round(monitor.state.threshold_m_s2, 3)}))
        losses = monitor.detector.losses.items()
        notices += [Notice("loss", f"no {name.name}: {loss}") for name, loss in losses if name not in monitor.heard]
    estimate = monitor.estimator.estimate
    is_hit = estimate is not None and estimate.impact.is_collision
    is_invalid = is_hit and not monitor.estimator.is_valid
    if is_invalid != monitor.invalidity_reported and monitor.state.phase is not Phase.CONTACT:
        monitor.invalidity_reported = is_invalid
        text = "velocity not valid: part of the hit was not measured" if is_invalid else "velocity valid again"
        notices.append(Notice("estimate", text))
    return notices
