"""Before the first flight: asks a vehicle that stands for streams and parameters, listens, and judges item by item.

Good, doubtful or bad, and the exact remedy. Bytes and the time in, bytes out.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum

from companion import messages
from companion.estimate.strapdown import GRAVITY_M_S2
from companion.flight.envelope import HELD_S
from companion.link import round_trip
from companion.link.round_trip import RoundTrip
from companion.link.streams import StreamMonitor
from companion.link.vehicle import Identity, identify, is_autopilot
from companion.mavlink.decode import Decoder
from companion.mavlink.encode import Encoder
from companion.messages import Sample, Vector3
from companion.mission.config import CompanionConfig

# What decides whether a collision is survived.
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
    imu: list[messages.ImuSample] = field(default_factory=list)
    positions_ned_m: list[Vector3] = field(default_factory=list)
    velocities_ned_m_s: list[Vector3] = field(default_factory=list)
    vibration: list[messages.Vibration] = field(default_factory=list)
    estimator: list[messages.EstimatorStatus] = field(default_factory=list)
    battery: messages.Battery | None = None
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
    return Survey(config, now_us, StreamMonitor(config.streams, (messages.MessageId.VIBRATION,)))


def advance(survey: Survey, samples: Sequence[Sample], now_us: int) -> list[messages.Outgoing]:
    """Take what was heard, return what is to be sent; call it every 50 ms at least."""
    survey._now_us = now_us
    outgoing: list[messages.Outgoing] = []
    for sample in samples:
        _hear(survey, sample, now_us, outgoing)
    if now_us >= survey._heartbeat_due_us:
        # From the start: a vehicle may wait for somebody before it speaks, or learn from it what time it is.
        survey._heartbeat_due_us = now_us + HEARTBEAT_INTERVAL_US
        outgoing.append(messages.OnboardHeartbeat(active=False))
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


def _hear(survey: Survey, sample: Sample, now_us: int, outgoing: list[messages.Outgoing]) -> None:
    listens = survey.listening_since_us is not None
    if listens:
        survey.streams.count(type(sample), now_us)
    match sample:
        case messages.Heartbeat() if is_autopilot(sample):
            survey.armed = sample.armed
            if survey.identity is None and survey.refusal is None:
                _meet(survey, sample, now_us)
        case messages.Parameter(name, value):
            if name in PARAMETERS:
                survey.parameters[name] = value
        case messages.AutopilotVersion(version):
            survey.version = version
        case messages.Battery():
            survey.battery = sample
        case messages.EstimatorStatus():
            survey.estimator.append(sample)
        case messages.TimeSyncRequest(vehicle_time_ns):
            outgoing.append(messages.TimeSyncReply(vehicle_time_ns, now_us * 1000))
        case messages.TimeSyncAnswer():
            survey.round_trip.hear(sample, now_us)
        case messages.ImuSample() if listens:
            survey.imu.append(sample)
        case messages.LocalPosition() if listens:
            survey.positions_ned_m.append(sample.position_ned_m)
            survey.velocities_ned_m_s.append(sample.velocity_ned_m_s)
        case messages.Vibration() if listens:
            survey.vibration.append(sample)
        case _:
            pass


def _meet(survey: Survey, heartbeat: messages.Heartbeat, now_us: int) -> None:
    identity = identify(heartbeat)
    if isinstance(identity, str):
        survey.refusal = identity
    else:
        survey.identity, survey.heard_since_us = identity, now_us


def _ask(survey: Survey, now_us: int, outgoing: list[messages.Outgoing]) -> None:
    asked = survey.round_trip.ask(now_us)
    if asked is not None:
        outgoing.append(asked)
    if now_us < survey._ask_due_us:
        return
    survey._ask_due_us = now_us + ASK_AGAIN_US
    outgoing += [messages.ReadParameter(name) for name in PARAMETERS if name not in survey.parameters]
    if survey.version is None:
        outgoing.append(messages.SendCommand(messages.RequestMessage(messages.MessageId.AUTOPILOT_VERSION), 0))
    if survey.listening_since_us is None:
        outgoing += [messages.SendCommand(stream.request(), 0) for stream in survey.streams.streams]
        outgoing.append(
            messages.SendCommand(messages.SetMessageInterval(messages.MessageId.ESTIMATOR_STATUS, 1_000_000), 0)
        )


def spread(vectors: Sequence[Vector3]) -> float:
    """Root mean squared distance from the mean."""
    count = len(vectors)
    if count == 0:
        return 0.0
    mean = [sum(vector[axis] for vector in vectors) / count for axis in range(3)]
    return math.sqrt(sum((vector[axis] - mean[axis]) ** 2 for vector in vectors for axis in range(3)) / count)


class Verdict(Enum):
    GOOD = "ok"
    DOUBTFUL = "look"
    BAD = "no"


@dataclass(frozen=True, slots=True)
class Finding:
    """`fix` is a parameter and the value that mends it; None where only a person can."""

    item: str
    verdict: Verdict
    found: str
    remedy: str = ""
    fix: tuple[str, int | float] | None = None


# PX4's parameters in bits and values (their descriptions in PX4's commander module).
RCL_EXCEPT_OFFBOARD = 4
RC_DISABLED = 4
FLIGHTTERM_OFF = 121212
# COM_OBL_RC_ACT: 0 position, 1 altitude, 2 stabilised, 3 return, 4 land, 5 hold, 6 terminate, 7 disarm.
LOSS_LAND, LOSS_NEEDS_STICKS, LOSS_DROPS = 4, (0, 1, 2), (6, 7)
LOSS_NAMES = ("position", "altitude", "stabilised", "return", "land", "hold", "terminate", "disarm")
# The least that PX4 documents: a lean of 11 degrees; beyond 10 a hit at 3 m/s tips a vehicle onto what it hits.
LEAST_ACC_HOR_M_S2 = 2.0
# Below PX4's default of 200 a sample is a mean over so long that short contacts vanish in it.
LEAST_INTEG_HZ = 200
# A contact of a stiff frame (the paper's accelerometer shows 0.001 s), for the share of them that samples see.
STIFF_CONTACT_S = 0.001
# Eq. 2 of the paper: a foldable arm's push begins with b_s v_c, b_s = 30 /s.
FOLDING_DAMPING_PER_S = 30.0
# The position of a vehicle that stands: more than this and a recovery by half a metre is lost in it.
MOST_WANDER_M, DOUBTFUL_WANDER_M = 0.5, 0.1
# Innovation test ratios: at 1 the estimator turns its sensors down, and PX4 warns from 0.5 on.
DOUBTFUL_RATIO, BAD_RATIO = 0.5, 1.0
# A round trip of so long is five IMU samples; beyond round_trip.MOST_US no flight begins.
DOUBTFUL_TRIP_US = 20_000
# PX4's BAT_LOW_THR is 15 %; a flight needs something above it.
DOUBTFUL_BATTERY, BAD_BATTERY = 50, 20
# A vehicle that stands still does not clip; a sensor that does shakes in its mount.
STANDS_M_S2 = 1.0


def findings(survey: Survey) -> list[Finding]:
    """All items, in the order in which they would be mended."""
    return [
        *_frame(survey),
        *_streams(survey),
        *_integration(survey),
        *_offboard_loss(survey),
        *_radio(survey),
        *_termination(survey),
        *_speeding_up(survey),
        *_estimate(survey),
        *_vibration(survey),
        *_time(survey),
        *_battery(survey),
        *_sight(survey),
    ]


def _frame(survey: Survey) -> Iterator[Finding]:
    """HEARTBEAT tells how many arms there are, not where: a quadrotor is taken for an X."""
    kind = "" if survey.identity is None else survey.identity.vehicle_type
    if kind != "quadrotor" and survey.config.estimate.fits_arms:
        remedy = "companion.estimate.fits_normal: false in the mission: the normal is the push's direction then"
        yield Finding("frame", Verdict.DOUBTFUL, f"{kind}: a hit's normal is fitted for a quad-x", remedy)
    else:
        yield Finding("frame", Verdict.GOOD, kind)


def _streams(survey: Survey) -> Iterator[Finding]:
    rates = survey.streams.rates_hz()
    for stream in survey.streams.streams:
        if not stream.min_hz:
            continue
        name, rate_hz = stream.message_id.name, rates.get(stream.message_id.name, 0.0)
        found = f"{rate_hz:.0f} Hz of {stream.asked_hz:g} asked for"
        if rate_hz < stream.min_hz:
            text = "serial: baud rate 921600 (SER_TEL2_BAUD), MAV_1_MODE 2 (Onboard), MAV_1_RATE 0; then ask again"
            yield Finding(name, Verdict.BAD, found, f"at least {stream.min_hz:g} Hz are needed; {text}")
        elif rate_hz < 0.4 * stream.asked_hz:
            text = "the link is full: baud rate 921600 and MAV_1_RATE 0 give HIGHRES_IMU about 200 Hz"
            yield Finding(name, Verdict.DOUBTFUL, found, text)
        else:
            yield Finding(name, Verdict.GOOD, found)


def _integration(survey: Survey) -> Iterator[Finding]:
    rate_hz = survey.parameters.get("IMU_INTEG_RATE")
    if rate_hz is None:
        yield _unread("IMU_INTEG_RATE")
        return
    found = f"{rate_hz:g} Hz: each sample is a mean over {1e3 / rate_hz:.1f} ms"
    if rate_hz < LEAST_INTEG_HZ:
        remedy = f"IMU_INTEG_RATE = {LEAST_INTEG_HZ}, then reboot"
        yield Finding("IMU_INTEG_RATE", Verdict.DOUBTFUL, found, remedy, ("IMU_INTEG_RATE", LEAST_INTEG_HZ))
    elif 1.0 / rate_hz > survey.config.estimate.imu_averaging_interval_s:
        remedy = f"companion.estimate.imu_averaging_interval_s: {1.0 / rate_hz:.4f} in the mission"
        yield Finding("IMU_INTEG_RATE", Verdict.DOUBTFUL, found, remedy)
    else:
        yield Finding("IMU_INTEG_RATE", Verdict.GOOD, found)


def _offboard_loss(survey: Survey) -> Iterator[Finding]:
    loss_s, action = survey.parameters.get("COM_OF_LOSS_T"), survey.parameters.get("COM_OBL_RC_ACT")
    if loss_s is None:
        yield _unread("COM_OF_LOSS_T")
    elif loss_s > HELD_S:
        found = f"{loss_s:g} s until PX4 acts when the companion has died; setpoints are made safe to hold {HELD_S:g} s"
        remedy = (
            f"COM_OF_LOSS_T = {HELD_S:g}; at 2 m/s the vehicle flies {2.0 * (loss_s - HELD_S):g} m further unattended"
        )
        yield Finding("COM_OF_LOSS_T", Verdict.DOUBTFUL, found, remedy, ("COM_OF_LOSS_T", HELD_S))
    else:
        yield Finding("COM_OF_LOSS_T", Verdict.GOOD, f"{loss_s:g} s until PX4 acts when the companion has died")
    if action is None:
        yield _unread("COM_OBL_RC_ACT")
        return
    number = int(action)
    name = LOSS_NAMES[number] if 0 <= number < len(LOSS_NAMES) else "unknown"
    found = f"{number} ({name}) when setpoints stop"
    remedy, fix = f"COM_OBL_RC_ACT = {LOSS_LAND} (land)", ("COM_OBL_RC_ACT", LOSS_LAND)
    if number in LOSS_DROPS:
        yield Finding("COM_OBL_RC_ACT", Verdict.BAD, found + ": the vehicle would fall", remedy, fix)
    elif number in LOSS_NEEDS_STICKS:
        text = "; without sticks PX4 sinks and lands, or returns"
        yield Finding("COM_OBL_RC_ACT", Verdict.DOUBTFUL, found + text, remedy, fix)
    else:
        yield Finding("COM_OBL_RC_ACT", Verdict.GOOD, found)


def _radio(survey: Survey) -> Iterator[Finding]:
    except_bits, source = survey.parameters.get("COM_RCL_EXCEPT"), survey.parameters.get("COM_RC_IN_MODE")
    if except_bits is None:
        yield _unread("COM_RCL_EXCEPT")
    elif source == RC_DISABLED:
        yield Finding("COM_RCL_EXCEPT", Verdict.GOOD, "no radio is expected (COM_RC_IN_MODE 4)")
    elif int(except_bits) & RCL_EXCEPT_OFFBOARD:
        yield Finding("COM_RCL_EXCEPT", Verdict.GOOD, "a lost radio does not end OFFBOARD")
    else:
        value = int(except_bits) | RCL_EXCEPT_OFFBOARD
        found = f"{int(except_bits)}: a lost radio ends OFFBOARD, in the middle of a recovery too"
        remedy = f"COM_RCL_EXCEPT = {value}, if the flight may go on without a radio"
        yield Finding("COM_RCL_EXCEPT", Verdict.DOUBTFUL, found, remedy, ("COM_RCL_EXCEPT", value))


def _termination(survey: Survey) -> Iterator[Finding]:
    breaker = survey.parameters.get("CBRK_FLIGHTTERM")
    if breaker is None:
        yield _unread("CBRK_FLIGHTTERM")
    elif breaker == FLIGHTTERM_OFF:
        yield Finding("CBRK_FLIGHTTERM", Verdict.GOOD, "a hit that tips the vehicle does not stop its motors")
    else:
        found = f"{breaker:g}: the failure detector stops the motors beyond FD_FAIL_R, FD_FAIL_P (60 degrees)"
        remedy = f"CBRK_FLIGHTTERM = {FLIGHTTERM_OFF}, unless a parachute or people below ask for it"
        yield Finding("CBRK_FLIGHTTERM", Verdict.DOUBTFUL, found, remedy, ("CBRK_FLIGHTTERM", FLIGHTTERM_OFF))


def _speeding_up(survey: Survey) -> Iterator[Finding]:
    """Of PX4's own modes, as `rebound guard` watches them; the companion's setpoints have their own limit."""
    most_m_s2 = survey.parameters.get("MPC_ACC_HOR")
    if most_m_s2 is None:
        yield _unread("MPC_ACC_HOR")
        return
    lean_deg = math.degrees(math.atan(most_m_s2 / GRAVITY_M_S2))
    found = f"{most_m_s2:g} m/s^2: PX4's own modes lean by {lean_deg:.0f} degrees as they speed up"
    if most_m_s2 > LEAST_ACC_HOR_M_S2:
        remedy = f"MPC_ACC_HOR = {LEAST_ACC_HOR_M_S2:g} for `rebound guard`: a vehicle that leans in tips where it hits"
        yield Finding("MPC_ACC_HOR", Verdict.DOUBTFUL, found, remedy, ("MPC_ACC_HOR", LEAST_ACC_HOR_M_S2))
    else:
        yield Finding("MPC_ACC_HOR", Verdict.GOOD, found)


def _estimate(survey: Survey) -> Iterator[Finding]:
    if not survey.positions_ned_m:
        remedy = "wait for GPS, flow or motion capture; QGroundControl's arming checks name what is missing"
        yield Finding("position", Verdict.BAD, "no LOCAL_POSITION_NED", remedy)
        return
    wander_m, noise_m_s = spread(survey.positions_ned_m), spread(survey.velocities_ned_m_s)
    seconds = LISTENING_US / 1e6
    found = f"standing, it wandered by {wander_m:.2f} m and {noise_m_s:.2f} m/s (RMS, {seconds:.0f} s)"
    remedy = "better position: RTK, flow with a range sensor, motion capture; or a larger recovery distance"
    verdict = Verdict.BAD if wander_m > MOST_WANDER_M else Verdict.DOUBTFUL
    yield (
        Finding("position", Verdict.GOOD, found)
        if wander_m <= DOUBTFUL_WANDER_M
        else Finding("position", verdict, found, remedy)
    )
    ratios = [ratio for status in survey.estimator for ratio in status.ratios]
    if not ratios:
        yield Finding("estimator", Verdict.DOUBTFUL, "no ESTIMATOR_STATUS", "look at EKF2 in QGroundControl")
        return
    found = f"largest innovation test ratio {max(ratios):.2f}"
    if not survey.estimator[-1].horizontal_velocity_is_good:
        remedy = "wait for GPS, flow or motion capture: v_c is taken from this velocity"
        yield Finding("estimator", Verdict.BAD, "no horizontal velocity", remedy)
        return
    if max(ratios) >= BAD_RATIO or any(e.accelerometer_is_doubted for e in survey.estimator):
        yield Finding("estimator", Verdict.BAD, found, "the estimator turns its sensors down: calibrate, check mounts")
    elif max(ratios) >= DOUBTFUL_RATIO:
        yield Finding("estimator", Verdict.DOUBTFUL, found, "calibrate compass and accelerometer")
    else:
        yield Finding("estimator", Verdict.GOOD, found)


def _vibration(survey: Survey) -> Iterator[Finding]:
    if survey.vibration:
        first, last = survey.vibration[0].clipping_counts, survey.vibration[-1].clipping_counts
        clipped = sum(last) - sum(first)
        found = f"{clipped} clipped samples while standing"
        if clipped:
            yield Finding("clipping", Verdict.BAD, found, "fasten the flight controller; check the accelerometer")
        else:
            yield Finding("clipping", Verdict.GOOD, found)
    if survey.imu:
        shakes_m_s2 = spread([sample.specific_force_frd_m_s2 for sample in survey.imu])
        found = f"{shakes_m_s2:.2f} m/s^2 (RMS) while standing"
        if shakes_m_s2 > STANDS_M_S2:
            yield Finding("shaking", Verdict.DOUBTFUL, found, "let the vehicle stand still, motors off, and ask again")
        else:
            yield Finding("shaking", Verdict.GOOD, found)


def _time(survey: Survey) -> Iterator[Finding]:
    median_us, worst_us = survey.round_trip.median_us, survey.round_trip.worst_us
    if median_us is None or worst_us is None:
        yield Finding("time", Verdict.DOUBTFUL, "TIMESYNC is not answered", "MAVLink 2 on the link (MAV_PROTO_VER 2)")
        return
    found = f"{median_us / 1e3:.1f} ms there and back (median), {worst_us / 1e3:.1f} ms at worst"
    if median_us > round_trip.MOST_US:
        yield Finding("time", Verdict.BAD, found, "a wire or a direct link instead of this one")
    elif median_us > DOUBTFUL_TRIP_US:
        yield Finding("time", Verdict.DOUBTFUL, found, "a wire instead of a radio; serial: baud rate 921600")
    else:
        yield Finding("time", Verdict.GOOD, found)


def _battery(survey: Survey) -> Iterator[Finding]:
    if survey.battery is None:
        yield Finding("battery", Verdict.DOUBTFUL, "unknown", "set up the power module (BAT1_SOURCE)")
        return
    remaining = survey.battery.remaining_percent
    verdict = Verdict.BAD if remaining < BAD_BATTERY else Verdict.DOUBTFUL
    if remaining >= DOUBTFUL_BATTERY:
        yield Finding("battery", Verdict.GOOD, f"{remaining} %")
    else:
        yield Finding("battery", verdict, f"{remaining} %", "charge it")


def _sight(survey: Survey) -> Iterator[Finding]:
    """By force alone and in the quiet of standing: a flight's vibration is `rebound tune`'s to judge."""
    rate_hz = survey.streams.rates_hz().get("HIGHRES_IMU", 0.0)
    if not rate_hz:
        return
    integ_hz = float(survey.parameters.get("IMU_INTEG_RATE", 1.0 / survey.config.estimate.imu_averaging_interval_s))
    threshold_m_s2 = survey.config.least_threshold_m_s2 or 0.0
    seen = min(1.0, rate_hz * (1.0 / integ_hz + STIFF_CONTACT_S))
    folding = f"arms that fold: from {threshold_m_s2 / FOLDING_DAMPING_PER_S:.2f} m/s on"
    stiff = f"stiff frames: {100 * seen:.0f} % of 1 ms contacts fall into a sample"
    verdict = Verdict.GOOD if seen > 0.9 else Verdict.DOUBTFUL
    remedy = "" if verdict is Verdict.GOOD else "a faster HIGHRES_IMU (see above); what falls between is found later"
    yield Finding("smallest hit", verdict, f"{folding}; {stiff}", remedy)


def _unread(name: str) -> Finding:
    return Finding(name, Verdict.DOUBTFUL, "the vehicle did not tell it", "ask again over a better link")


class Preflight:
    """Joins the codec with the pure survey; holds no clock and no socket. Times are microseconds, any epoch."""

    def __init__(self, config: CompanionConfig, now_us: int) -> None:
        self._decoder, self._encoder = Decoder(), Encoder()
        self.survey: Survey = start_survey(config, now_us)

    def step(self, received: bytes, now_us: int) -> tuple[bytes, ...]:
        """Call with what was received since the last call; what is to be sent."""
        survey = self.survey
        samples = [sample for _, sample in self._decoder.feed(received) if sample is not None]
        is_known = survey.identity is not None
        outgoing = advance(survey, samples, now_us)
        if survey.identity is not None and not is_known:
            self._decoder.listen_to(survey.identity.system_id, survey.identity.component_id)
            self._encoder.speak_to(survey.identity.system_id, survey.identity.component_id)
        return tuple(packet for message in outgoing for packet in self._encoder.packets(message))

    def set_parameter(self, name: str, value: int | float, now_us: int) -> tuple[bytes, ...]:
        """What sets it; `parameter` shows the vehicle's answer after further steps."""
        self.survey.parameters.pop(name, None)
        return (*self._encoder.packets(messages.SetParameter(name, value)), *self.step(b"", now_us))

    def parameter(self, name: str) -> int | float | None:
        """As the vehicle last told it."""
        return self.survey.parameters.get(name)

    @property
    def finished(self) -> bool:
        return self.survey.finished

    def findings(self) -> list[Finding]:
        """All items; complete once `finished` without a refusal."""
        return findings(self.survey)
