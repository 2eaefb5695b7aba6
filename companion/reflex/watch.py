"""The watch for collisions: detector, estimate and sight joined; pure, and the same in flight, replay and bench.

A `Watch` is changed only by `advance`: the same samples at the same times give the same impacts and notices.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from pydantic import field_validator, model_validator

from companion.detection.fused_config import FusedConfig
from companion.detection.interface import Detector, DetectorState, Phase, Situation
from companion.detection.registry import BASELINES, DETECTORS, MakeDetector, check_known_detector
from companion.detection.sight import Sameness, Sight, SightConfig, Turning, heard, why_blind
from companion.estimate.config import EstimateConfig
from companion.estimate.impact import ImpactEstimate, ImpactEstimator
from companion.estimate.normal import prepare
from companion.messages import Attitude, AttitudeTarget, ImuSample, MessageId, Odometry, Refused, Sample, Vibration
from companion.motion.history import REBOOT_US
from companion.written import Written

# What a detector may make use of besides HIGHRES_IMU; the slowest is PX4's VIBRATION, every two seconds by default.
WISHED: dict[type, MessageId] = {
    AttitudeTarget: MessageId.ATTITUDE_TARGET,
    Odometry: MessageId.ODOMETRY,
    Vibration: MessageId.VIBRATION,
}
HEARD_US = 3_000_000


class WatchConfig(Written):
    """Settings of the watch for collisions."""

    detectors: ClassVar[Mapping[str, MakeDetector]] = DETECTORS
    """What `detector` may name. Whoever has others extends this class by them, and by a key for each one's settings."""

    detector: str = "fused"
    """Its own settings are those under its name."""
    fused: FusedConfig = FusedConfig()
    sight: SightConfig = SightConfig()
    estimate: EstimateConfig = EstimateConfig()

    @property
    def least_threshold_m_s2(self) -> float | None:
        """What the chosen detector asks for sideways of a vehicle that does not shake; None if it looks at no force."""
        settings = getattr(self, self.detector)
        names = ("side_threshold_m_s2", "threshold_m_s2")
        return next((float(getattr(settings, name)) for name in names if hasattr(settings, name)), None)

    @model_validator(mode="before")
    @classmethod
    def _no_settings_of_baselines(cls, data: object) -> object:
        """They would have no effect; why not is said better than of any other unknown key."""
        for key in sorted(BASELINES.intersection(data) if isinstance(data, dict) else ()):
            check_known_detector(key, cls.detectors)
        return data

    @field_validator("detector")
    @classmethod
    def _known_detector(cls, name: str) -> str:
        check_known_detector(name, cls.detectors)
        return name


@dataclass(frozen=True, slots=True)
class Notice:
    """Something about the detector itself that is worth a line in the timeline."""

    kind: str  # of the event
    text: str
    data: Mapping[str, float]


@dataclass(slots=True)
class Watch:
    """All that is remembered between steps; copies and pickles as a whole."""

    config: WatchConfig
    detector: Detector[Any]
    state: DetectorState
    estimator: ImpactEstimator
    sight: Sight
    started_us: int
    sameness: Sameness = field(default_factory=Sameness)
    turning: Turning = field(default_factory=Turning)
    last_imu_boot_us: int = 0
    useless: str | None = None  # what was wrong with the newest IMU message
    threshold_told: bool = False
    losses_told: bool = False
    doubt_told: bool = False
    heard: set[MessageId] = field(default_factory=set)

    @property
    def blind_reason(self) -> str | None:
        """Why a hit might not be seen although the detector is on; None while it sees."""
        return self.sight.blind_reason

    @property
    def is_attitude_old(self) -> bool:
        """Whether forces can no longer be summed up to what velocities are held against."""
        latest = self.turning.latest
        return latest is not None and self.last_imu_boot_us - latest.time_boot_us > self.config.sight.silence_s * 1e6

    @property
    def estimate_trusted(self) -> bool:
        """False while the vehicle's velocity and position cannot be believed: part of a hit was not measured.

        For the detector and the timeline; a recovery flies by `reflex.reckoning`.
        """
        return self.estimator.trust.is_trusted

    @property
    def estimate(self) -> ImpactEstimate | None:
        """Of the latest impact, as known by now."""
        return self.estimator.estimate

    def describe(self) -> str:
        """For the live line."""
        return self.state.describe() if self.blind_reason is None else f"blind ({self.blind_reason})"


@dataclass(frozen=True, slots=True)
class Seen:
    """What one step showed: impacts as known at their first sample, estimates of contacts now over, notices."""

    impacts: Sequence[ImpactEstimate]
    finished: Sequence[ImpactEstimate]
    notices: Sequence[Notice]


NOTHING_SEEN = Seen((), (), ())


def start_watch(config: WatchConfig, now_us: int) -> Watch:
    """A watch that has seen nothing; ``now_us`` on the same clock as `advance`'s."""
    if config.estimate.fits_arms:
        prepare()
    averaging_us = round(config.estimate.imu_averaging_interval_s * 1e6)
    detector = config.detectors[config.detector](getattr(config, config.detector), averaging_us)
    return Watch(config, detector, detector.initial(), ImpactEstimator(config.estimate), Sight(now_us, now_us), now_us)


def advance(watch: Watch, samples: Sequence[Sample], situation: Situation, now_us: int) -> Seen:
    """Take the samples heard since the last call, in the order heard; call now and then without any, too."""
    impacts: list[ImpactEstimate] = []
    finished: list[ImpactEstimate] = []
    imu_samples = 0
    situation = situation._replace(inertial=watch.estimator.inertial)
    for sample in samples:
        if type(sample) is ImuSample:
            if watch.sameness.imu(sample):
                watch.useless = "IMU stuck at one value"
                continue
            watch.useless = None
            watch.turning.imu(sample)
            imu_samples += 1
            if 0 <= watch.last_imu_boot_us - sample.time_boot_us < REBOOT_US:
                continue
            watch.last_imu_boot_us = sample.time_boot_us
        elif type(sample) is Attitude:
            watch.sameness.attitude(sample)
            if not watch.turning.attitude(sample):
                continue
        elif type(sample) is Refused:
            if sample.message == MessageId.HIGHRES_IMU.name:
                watch.useless = f"HIGHRES_IMU not accepted: {sample.reason}"
            continue
        elif not watch.losses_told and type(sample) in WISHED:
            watch.heard.add(WISHED[type(sample)])
        watch.estimator.hear(sample)
        is_attitude_old = watch.is_attitude_old
        if is_attitude_old:
            watch.estimator.inertial.fixes.clear()
        known = situation
        if not watch.estimator.trust.is_trusted or is_attitude_old:
            known = situation._replace(estimate_trusted=False)
        watch.state, impact = watch.detector.step(watch.state, sample, known)
        if impact is not None:
            cut_short = watch.estimator.close()
            if cut_short is not None:
                finished.append(cut_short)
            impacts.append(watch.estimator.begin(impact, situation))
        elif type(sample) is ImuSample:
            final = watch.estimator.follow(watch.state)
            if final is not None:
                finished.append(final)
    notices = _look_after_sight(watch, imu_samples, situation, now_us) + _tell_doubt(watch)
    if not impacts and not finished and not notices:
        return NOTHING_SEEN
    return Seen(impacts, finished, notices)


def _look_after_sight(watch: Watch, imu_samples: int, situation: Situation, now_us: int) -> list[Notice]:
    """Blind or seeing, told when it changes and only while the detector is on; and, once, the threshold."""
    notices: list[Notice] = []
    sight = heard(watch.sight, imu_samples, watch.config.sight, now_us)
    on = situation.off_reason is None
    threshold_m_s2 = watch.state.threshold_m_s2
    reason = why_blind(sight, threshold_m_s2, watch.config.sight, now_us, watch.useless) if on else None
    if on and reason is None and watch.is_attitude_old:
        reason = f"no ATTITUDE_QUATERNION for {round(watch.config.sight.silence_s * 1e3)} ms"
    if (reason is None) != (sight.blind_reason is None) and on:
        text = "the detector sees again" if reason is None else f"detector blind: {reason}"
        notices.append(Notice("link", text, {}))
    watch.sight = sight if reason == sight.blind_reason else sight._replace(blind_reason=reason)
    if not watch.threshold_told and watch.state.phase is Phase.ARMED:
        watch.threshold_told = True
        text = f"detector '{watch.detector.name}' on the watch: a hit is {threshold_m_s2:.1f} m/s^2 or more"
        notices.append(Notice("detector", text, {"threshold_m_s2": round(threshold_m_s2, 3)}))
    if not watch.losses_told and watch.state.phase is Phase.ARMED and now_us - watch.started_us >= HEARD_US:
        watch.losses_told = True
        if watch.config.estimate.fits_arms and not watch.estimator.fits_normal:
            text = "an obstacle's normal comes from its push alone: install px4-rebound[fit]"
            notices.append(Notice("loss", text, {}))
        for message, loss in watch.detector.losses.items():
            if message not in watch.heard:
                notices.append(Notice("loss", f"no {message.name}: {loss}", {}))
    return notices


def _tell_doubt(watch: Watch) -> list[Notice]:
    """Report that the velocity estimate is not valid, once the contact is over, and when it is valid again."""
    doubted = not watch.estimate_trusted and watch.state.phase is not Phase.CONTACT
    if doubted == watch.doubt_told:
        return []
    watch.doubt_told = doubted
    text = "velocity not valid: part of the hit was not measured" if doubted else "velocity valid again"
    return [Notice("estimate", text, {})]
