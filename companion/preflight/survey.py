"""The survey of a vehicle that stands: asks for streams and parameters, listens, and is done after a stated time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.link.identity import Identity, identify, is_autopilot
from companion.link.round_trip import RoundTrip
from companion.link.streams import StreamMonitor
from companion.messages import (
    AutopilotVersion,
    Battery,
    EstimatorStatus,
    Heartbeat,
    ImuSample,
    LocalPosition,
    MessageId,
    OnboardHeartbeat,
    Outgoing,
    Parameter,
    ReadParameter,
    RequestMessage,
    Sample,
    SendCommand,
    SetMessageInterval,
    TimeSyncAnswer,
    TimeSyncReply,
    TimeSyncRequest,
    Vector3,
    Vibration,
)
from companion.mission.config import CompanionConfig

# What decides whether a collision is survived; see `checks` for each.
PARAMETERS = (
    "COM_OF_LOSS_T",
    "COM_OBL_RC_ACT",
    "COM_RC_IN_MODE",
    "COM_RCL_EXCEPT",
    "CBRK_FLIGHTTERM",
    "IMU_INTEG_RATE",
    "MPC_ACC_HOR",
)
# The streams need a second to settle at their new rates; what comes then counts.
SETTLING_US = 1_000_000
# 2500 IMU samples, ten ESTIMATOR_STATUS, a position that has time to wander.
LISTENING_US = 10_000_000
HEARTBEAT_INTERVAL_US = 1_000_000
# A lost question is asked again; PX4 answers a parameter within 50 ms.
ASK_AGAIN_US = 500_000


@dataclass(slots=True)
class Survey:
    """All that is heard. Times on the companion's clock unless named boot times."""

    config: CompanionConfig
    started_us: int
    streams: StreamMonitor
    identity: Identity | None = None
    refusal: str | None = None
    armed: bool = False
    version: tuple[int, int, int] | None = None
    heard_since_us: int | None = None
    listening_since_us: int | None = None
    parameters: dict[str, int | float] = field(default_factory=dict)
    imu: list[ImuSample] = field(default_factory=list)
    positions_ned_m: list[Vector3] = field(default_factory=list)
    velocities_ned_m_s: list[Vector3] = field(default_factory=list)
    vibration: list[Vibration] = field(default_factory=list)
    estimator: list[EstimatorStatus] = field(default_factory=list)
    battery: Battery | None = None
    round_trip: RoundTrip = field(default_factory=RoundTrip)
    _now_us: int = 0
    _heartbeat_due_us: int = 0
    _ask_due_us: int = 0

    @property
    def finished(self) -> bool:
        return self.refusal is not None or (
            self.listening_since_us is not None and self._now_us >= self.listening_since_us + LISTENING_US
        )


def start_survey(config: CompanionConfig, now_us: int) -> Survey:
    return Survey(config, now_us, StreamMonitor(config.streams, (MessageId.VIBRATION,)))


def advance(survey: Survey, samples: Sequence[Sample], now_us: int) -> list[Outgoing]:
    """Take what was heard, return what is to be sent; call it every 50 ms at least."""
    survey._now_us = now_us
    outgoing: list[Outgoing] = []
    for sample in samples:
        _hear(survey, sample, now_us, outgoing)
    if now_us >= survey._heartbeat_due_us:
        # From the start: a vehicle may wait for somebody before it speaks, or learn from it what time it is.
        survey._heartbeat_due_us = now_us + HEARTBEAT_INTERVAL_US
        outgoing.append(OnboardHeartbeat(active=False))
    if survey.identity is None:
        if survey.refusal is None and now_us - survey.started_us > survey.config.link.heartbeat_wait_s * 1e6:
            wait_s = survey.config.link.heartbeat_wait_s
            survey.refusal = f"no PX4 was heard within {wait_s:g} s; check the address, the cable and the baud rate"
        return outgoing
    _ask(survey, now_us, outgoing)
    since_us = now_us if survey.heard_since_us is None else survey.heard_since_us
    if survey.listening_since_us is None and now_us - since_us >= SETTLING_US:
        survey.listening_since_us = now_us
        survey.streams.start(now_us)
    return outgoing


def _hear(survey: Survey, sample: Sample, now_us: int, outgoing: list[Outgoing]) -> None:
    listens = survey.listening_since_us is not None
    if listens:
        survey.streams.count(type(sample), now_us)
    match sample:
        case Heartbeat() if is_autopilot(sample):
            survey.armed = sample.armed
            if survey.identity is None and survey.refusal is None:
                _meet(survey, sample, now_us)
        case Parameter(name, value):
            if name in PARAMETERS:
                survey.parameters[name] = value
        case AutopilotVersion(version):
            survey.version = version
        case Battery():
            survey.battery = sample
        case EstimatorStatus():
            survey.estimator.append(sample)
        case TimeSyncRequest(vehicle_time_ns):
            outgoing.append(TimeSyncReply(vehicle_time_ns, now_us * 1000))
        case TimeSyncAnswer():
            survey.round_trip.hear(sample, now_us)
        case ImuSample() if listens:
            survey.imu.append(sample)
        case LocalPosition() if listens:
            survey.positions_ned_m.append(sample.position_ned_m)
            survey.velocities_ned_m_s.append(sample.velocity_ned_m_s)
        case Vibration() if listens:
            survey.vibration.append(sample)
        case _:
            pass


def _meet(survey: Survey, heartbeat: Heartbeat, now_us: int) -> None:
    identity = identify(heartbeat)
    if isinstance(identity, str):
        survey.refusal = identity
    else:
        survey.identity, survey.heard_since_us = identity, now_us


def _ask(survey: Survey, now_us: int, outgoing: list[Outgoing]) -> None:
    asked = survey.round_trip.ask(now_us)
    if asked is not None:
        outgoing.append(asked)
    if now_us < survey._ask_due_us:
        return
    survey._ask_due_us = now_us + ASK_AGAIN_US
    outgoing += [ReadParameter(name) for name in PARAMETERS if name not in survey.parameters]
    if survey.version is None:
        outgoing.append(SendCommand(RequestMessage(MessageId.AUTOPILOT_VERSION), 0))
    if survey.listening_since_us is None:
        outgoing += [SendCommand(stream.request(), 0) for stream in survey.streams.streams]
        outgoing.append(SendCommand(SetMessageInterval(MessageId.ESTIMATOR_STATUS, 1_000_000), 0))


def spread(vectors: Sequence[Vector3]) -> float:
    """Root mean squared distance from the mean."""
    count = len(vectors)
    if count == 0:
        return 0.0
    mean = [sum(vector[axis] for vector in vectors) / count for axis in range(3)]
    return math.sqrt(sum((vector[axis] - mean[axis]) ** 2 for vector in vectors for axis in range(3)) / count)
