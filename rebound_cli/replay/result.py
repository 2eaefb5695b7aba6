"""One replay from log to findings, whichever kind of log it is."""

import math
from dataclasses import dataclass, replace

from companion.messages import (
    Attitude,
    AttitudeTarget,
    ExtendedState,
    LocalPosition,
    MessageId,
    Odometry,
    Vibration,
)
from companion.mission.config import CompanionConfig
from rebound_cli.logs.log import Log, LogError
from rebound_cli.logs.shaking import Shaking, shaking
from rebound_cli.replay.findings import Findings
from rebound_cli.replay.recording import Recording
from rebound_cli.replay.reproduction import Reproduction, reproduce
from rebound_cli.replay.watching import thinned, watch_log

_SAMPLES = {
    MessageId.LOCAL_POSITION_NED: LocalPosition,
    MessageId.ATTITUDE_QUATERNION: Attitude,
    MessageId.ATTITUDE_TARGET: AttitudeTarget,
    MessageId.EXTENDED_SYS_STATE: ExtendedState,
    MessageId.ODOMETRY: Odometry,
    MessageId.VIBRATION: Vibration,
}


@dataclass(frozen=True, slots=True)
class Replay:
    """What was looked at, with what, and what was found. `log` is as the detector heard it."""

    log: Log
    detector: str
    recorded_rate_hz: float
    shaking: Shaking
    findings: Findings
    losses: tuple[str, ...]
    reproduction: Reproduction | None


def replay_log(log: Log, config: CompanionConfig, rate_hz: float | None) -> Replay:
    """The detector over the log. Raises LogError when the rate leaves nothing."""
    recorded_hz = shaking(log).rate_hz
    if rate_hz is not None:
        log = replace(log, heard=tuple(thinned(log.heard, rate_hz)))
        if len(log.imu()) < 2:
            raise LogError(f"{log.path}: at {rate_hz:g} Hz fewer than two IMU samples of the log are left.")
    findings = watch_log(log, config)
    return Replay(log, config.detector, recorded_hz, shaking(log), findings, _losses(log, config), None)


def replay_flight(log: Log, recording: Recording) -> Replay:
    """Our own flight decided again, from the first byte to the last."""
    config = recording.settings.companion
    reproduction = reproduce(recording)
    # The flight's own zero, so that times are those of its timeline.
    log = replace(log, started_at_us=recording.steps[0].time_us)
    shown = shaking(log)
    losses = _losses(log, config)
    return Replay(log, config.detector, shown.rate_hz, shown, reproduction.findings, losses, reproduction)


def _losses(log: Log, config: CompanionConfig) -> tuple[str, ...]:
    """What the log lacks, and what the detector loses by it."""
    detector = config.detectors[config.detector](getattr(config, config.detector), 0)
    kinds = {type(heard.sample) for heard in log.heard}
    missing = [
        f"without {message.name} '{config.detector}' loses: {loss}"
        for message, loss in detector.losses.items()
        if message in _SAMPLES and _SAMPLES[message] not in kinds
    ]
    if log.other_arms is not None and config.estimate.fits_arms:
        missing.append(f"a {log.other_arms}: a hit's normal is fitted for the four arms of a quad-x")
    return (*log.losses, *missing)


def peak_m_s2(log: Log) -> float:
    """The largest specific force in one sample."""
    return max(math.hypot(*sample.specific_force_frd_m_s2) for _, sample in log.imu())
