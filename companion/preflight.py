"""Before the first flight: asks a vehicle that stands for streams and parameters, listens, and judges item by item."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from companion import messages
from companion.autopilot.known import NAMES
from companion.autopilot.setup import PreflightItem, SerialLine, Setup, judged
from companion.link.round_trip import MOST_US as MOST_TRIP_US
from companion.link.round_trip import RoundTrip
from companion.link.streams import StreamMonitor
from companion.link.vehicle import Vehicle, identify, is_autopilot
from companion.mavlink.decode import Decoder
from companion.mavlink.delivery import Delivery
from companion.mavlink.encode import Encoder
from companion.messages import MessageId, Sample, SendCommand, Vector3
from companion.mission.config import CompanionConfig
from companion.reflex.detection.health import alarms_per_h

# The streams need a second to settle at their new rates; what comes then counts.
SETTLING_US = 1_000_000
# 2500 IMU samples, ten ESTIMATOR_STATUS, a position that has time to wander.
LISTENING_US = 10_000_000
HEARTBEAT_INTERVAL_US = 1_000_000
# A lost question is asked again; PX4 answers a parameter within 50 ms.
ASK_AGAIN_US = 500_000

# The position of a vehicle that stands: more than this and a recovery by half a metre is lost in it.
MOST_WANDER_M, DOUBTFUL_WANDER_M = 0.5, 0.1
# Innovation test ratios: at 1 the estimator turns its sensors down, and PX4 warns from 0.5 on.
DOUBTFUL_RATIO, BAD_RATIO = 0.5, 1.0
# A round trip of so long is five IMU samples; beyond round_trip.MOST_US no flight begins.
DOUBTFUL_TRIP_US = 20_000
# Autopilots warn at 15 %; a flight needs something above it.
DOUBTFUL_BATTERY, BAD_BATTERY = 50, 20
# A vehicle that stands still does not clip; a sensor that does shakes in its mount.
STANDS_M_S2 = 1.0
# A converter of FTDI's holds bytes back for up to 16 ms by default (FTDI's AN232B-04). Delays that differ by half of
# that are no wire's.
UNEVEN_US = 8_000


@dataclass(slots=True)
class Preflight:
    """All that is heard. Holds no clock and no socket; times are microseconds of any epoch."""

    config: CompanionConfig
    started_us: int
    line: SerialLine | None = None
    streams: StreamMonitor = field(init=False)
    delivery: Delivery = field(default_factory=Delivery)
    vehicle: Vehicle = field(default_factory=Vehicle)
    refusal: str | None = None
    heard_since_us: int | None = None
    parameters: dict[str, int | float] = field(default_factory=dict)
    forces: list[Vector3] = field(default_factory=list)
    positions: list[messages.LocalPosition] = field(default_factory=list)
    vibration: list[messages.Vibration] = field(default_factory=list)
    estimator: list[messages.EstimatorStatus] = field(default_factory=list)
    round_trip: RoundTrip = field(default_factory=RoundTrip)
    now_us: int = 0
    heartbeat_due_us: int = 0
    ask_due_us: int = 0
    _decoder: Decoder = field(default_factory=Decoder)
    _encoder: Encoder = field(default_factory=Encoder)

    def __post_init__(self) -> None:
        self.streams = StreamMonitor(self.config.streams, (MessageId.VIBRATION,))

    @property
    def flies(self) -> bool:
        """Somebody hovers it: what shakes then is the propellers' doing."""
        return self.vehicle.armed is True and self.vehicle.landed is messages.LandedState.IN_AIR

    @property
    def finished(self) -> bool:
        since_us = self.streams.started_us
        return self.refusal is not None or (since_us is not None and self.now_us >= since_us + LISTENING_US)

    @property
    def _listens(self) -> bool:
        """What is set afterwards, and the time in which a person reads, changes nothing of what was listened to."""
        return self.streams.started_us is not None and not self.finished

    def step(self, received: bytes, now_us: int) -> tuple[bytes, ...]:
        """Call with what was received since the last call, every 50 ms at least; what is to be sent."""
        frames, known = self._decoder.feed(received), self.vehicle.identity
        if known is not None and self._listens:
            for frame, _ in frames:
                self.delivery.take(frame, (known.system_id, known.component_id))
        outgoing = self.advance([sample for _, sample in frames if sample is not None], now_us)
        identity = self.vehicle.identity
        if identity is not None and known is None:
            self._decoder.listen_to(identity.system_id, identity.component_id, identity.autopilot)
            self._encoder.speak_to(identity.system_id, identity.component_id, identity.autopilot)
        return tuple(packet for message in outgoing for packet in self._encoder.packets(message))

    def set_parameter(self, name: str, value: int | float, now_us: int) -> tuple[bytes, ...]:
        """Packets that set it. `parameters` has the vehicle's answer after further steps."""
        self.parameters.pop(name, None)
        return (*self._encoder.packets(messages.Parameter(name, value)), *self.step(b"", now_us))

    def advance(self, samples: Sequence[Sample], now_us: int) -> list[messages.Outgoing]:
        """A step without the codec."""
        self.now_us = now_us
        outgoing: list[messages.Outgoing] = []
        for sample in samples:
            self._hear(sample, outgoing)
        if now_us >= self.heartbeat_due_us:
            # From the start: a vehicle may wait for somebody before it speaks, or learn from it what time it is.
            self.heartbeat_due_us = now_us + HEARTBEAT_INTERVAL_US
            outgoing.append(messages.OnboardHeartbeat(active=False))
        if self.heard_since_us is None:
            wait_s = self.config.link.heartbeat_wait_s
            if now_us - self.started_us > wait_s * 1e6:
                text = f"no {NAMES} was heard within {wait_s:g} s; check the address, the cable and the baud rate"
                self.refusal = self.refusal or text
            return outgoing
        self._ask(outgoing)
        if self.streams.started_us is None and now_us - self.heard_since_us >= SETTLING_US:
            self.streams.start(now_us)
        return outgoing

    def _hear(self, sample: Sample, outgoing: list[messages.Outgoing]) -> None:
        now_us, listens = self.now_us, self._listens
        if isinstance(sample, messages.Heartbeat) and not is_autopilot(sample):
            return  # before the vehicle is met others are heard, too
        self.vehicle.update(sample, now_us)
        if listens:
            self.streams.count(type(sample), now_us)
        match sample:
            case messages.Heartbeat() if self.heard_since_us is None and self.refusal is None:
                identity = identify(sample)
                if isinstance(identity, str):
                    self.refusal = identity
                else:
                    self.heard_since_us = now_us
                    self.vehicle.identity, self.vehicle.autopilot = identity, identity.autopilot
            case messages.Parameter(name, value) if name in self.vehicle.autopilot.parameters:
                self.parameters[name] = value
            case messages.EstimatorStatus():
                self.estimator.append(sample)
            case messages.TimeSync(asked_ns, None):
                outgoing.append(messages.TimeSync(asked_ns, now_us * 1000))
            case messages.TimeSync():
                self.round_trip.update(sample, now_us)
            case messages.ImuSample() if listens:
                self.forces.append(sample.specific_force_frd_m_s2)
                self.delivery.delays_us.append((sample.time_boot_us, now_us - sample.time_boot_us))
            case messages.LocalPosition() if listens:
                self.positions.append(sample)
            case messages.Vibration() if listens:
                self.vibration.append(sample)

    def _ask(self, outgoing: list[messages.Outgoing]) -> None:
        if self.now_us >= self.round_trip.due_us:
            outgoing.append(self.round_trip.ask(self.now_us))
        if self.now_us < self.ask_due_us:
            return
        self.ask_due_us = self.now_us + ASK_AGAIN_US
        autopilot = self.vehicle.autopilot
        outgoing += [messages.ReadParameter(name) for name in autopilot.parameters if name not in self.parameters]
        is_known = self.vehicle.version is not None
        commands = [] if is_known else [messages.request_message(MessageId.AUTOPILOT_VERSION)]
        if self.streams.started_us is None:
            commands += [*(stream.request() for stream in self.streams.streams), *autopilot.streams]
            if autopilot.lesser_imu is not None:
                # Of a board that has no other. Where both come, the finer one counts.
                interval_us = round(1e6 / self.config.streams.highres_imu_hz)
                commands.append(messages.set_message_interval(autopilot.lesser_imu, interval_us))
            commands.append(messages.set_message_interval(autopilot.estimator_message, 1_000_000))
        outgoing += [SendCommand(command, 0) for command in commands]


def spread(vectors: Sequence[Vector3]) -> float:
    """Root mean squared distance from the mean."""
    return float(np.sqrt(np.var(vectors, axis=0).sum()))


def findings(survey: Preflight) -> list[PreflightItem]:
    """All items, in the order in which they would be mended."""
    vehicle, fused = survey.vehicle, survey.config.fused
    imu_hz = survey.streams.rates_hz().get("HIGHRES_IMU", 0.0)
    per_h = alarms_per_h(fused.noise_factor, imu_hz)
    autopilot = vehicle.autopilot
    setup = Setup(
        parameters=survey.parameters,
        line=survey.line,
        vehicle_type="" if vehicle.identity is None else vehicle.identity.vehicle_type,
        estimate=survey.config.estimate,
        imu_hz=imu_hz,
        threshold_m_s2=fused.side_threshold_m_s2,
        false_alarms=f"at most {per_h:.2g} false alarms an hour by Gaussian vibration",
    )
    found = [item for judge in autopilot.judge_vehicle for item in judge(setup)]
    found += [*_delivery(survey), *_streams(survey)]
    found += autopilot.judge_parameters(setup)
    found += [*_estimate(survey), *_vibration(survey), _time(survey), _battery(survey)]
    return [*found, autopilot.sight(setup)] if imu_hz else found


def _delivery(survey: Preflight) -> Iterator[PreflightItem]:
    delivery, line = survey.delivery, survey.line
    if delivery.received:
        lost, bad, sent = delivery.lost, delivery.unreadable_bytes, delivery.received + delivery.lost
        remedy = "a wire loses nothing: ground beside it, short, the same baud rate at both ends"
        found = f"{lost} of {sent} packets lost ({100.0 * lost / sent:.1f} %), {bad} unreadable bytes"
        yield judged("packets", found, lost > 0 or bad > 0, remedy)
    if delivery.signed and not survey.parameters:
        # With a key, packets come here without their signatures.
        found = "the vehicle signs its packets and answers nothing that has no signature"
        yield judged("signing", found, is_bad=True, remedy="--signing-key FILE, with the key that the vehicle has")
    jitter_us, timer_ms = delivery.jitter_us, None if line is None else line.latency_timer_ms
    if jitter_us is not None:
        held = "an FTDI converter's latency timer is " + ("16 ms by default" if timer_ms is None else f"{timer_ms} ms")
        remedy = f"{held}; 1 ms is best (`rebound service install` sets it); a busy computer does the same"
        is_held = timer_ms is not None and timer_ms > 1
        found = f"delays of samples differ by {jitter_us / 1e3:.1f} ms"
        yield judged("arrival", found, is_held or jitter_us > UNEVEN_US, remedy)


def _streams(survey: Preflight) -> Iterator[PreflightItem]:
    rates = survey.streams.rates_hz()
    autopilot = survey.vehicle.autopilot
    for stream in survey.streams.streams:
        if stream.min_hz:
            name = stream.message_id.name
            rate_hz = rates.get(name, 0.0)
            is_bad, is_less = rate_hz < stream.min_hz, rate_hz < 0.4 * stream.asked_hz
            needed = f"at least {stream.min_hz:g} Hz are needed; {autopilot.remedy_slow_stream}"
            found = f"{rate_hz:.0f} Hz of {stream.asked_hz:g} asked for"
            yield judged(name, found, is_less, needed if is_bad else autopilot.remedy_full_link, is_bad)


def _estimate(survey: Preflight) -> Iterator[PreflightItem]:
    if not survey.positions:
        remedy = "wait for GPS, flow or motion capture; QGroundControl's arming checks name what is missing"
        yield judged("position", "no LOCAL_POSITION_NED", is_bad=True, remedy=remedy)
        return
    if not survey.flies:
        wander_m = spread([sample.position_ned_m for sample in survey.positions])
        noise_m_s = spread([sample.velocity_ned_m_s for sample in survey.positions])
        seconds = LISTENING_US / 1e6
        remedy = "better position: RTK, flow with a range sensor, motion capture; or a larger recovery distance"
        found = f"standing, it wandered by {wander_m:.2f} m and {noise_m_s:.2f} m/s (RMS, {seconds:.0f} s)"
        yield judged("position", found, wander_m > DOUBTFUL_WANDER_M, remedy, wander_m > MOST_WANDER_M)
    worst = max((ratio for status in survey.estimator for ratio in status.ratios), default=None)
    if worst is None:
        autopilot = survey.vehicle.autopilot
        yield judged("estimator", f"no {autopilot.estimator_message.name}", True, autopilot.remedy_no_estimator)
    elif not survey.estimator[-1].horizontal_velocity_is_good:
        remedy = "wait for GPS, flow or motion capture: v_c is taken from this velocity"
        yield judged("estimator", "no horizontal velocity", is_bad=True, remedy=remedy)
    else:
        is_bad = worst >= BAD_RATIO or any(status.accelerometer_is_faulty for status in survey.estimator)
        worse = "the estimator turns its sensors down: calibrate, check mounts"
        remedy = worse if is_bad else "calibrate compass and accelerometer"
        yield judged("estimator", f"largest innovation test ratio {worst:.2f}", worst >= DOUBTFUL_RATIO, remedy, is_bad)


def _vibration(survey: Preflight) -> Iterator[PreflightItem]:
    doing = "hovering" if survey.flies else "standing"
    if survey.vibration:
        clipped = survey.vibration[-1].clipped - survey.vibration[0].clipped
        remedy = "fasten the flight controller; check the accelerometer"
        yield judged("clipping", f"{clipped} clipped samples while {doing}", is_bad=clipped != 0, remedy=remedy)
    if not survey.forces:
        return
    shakes_m_s2, threshold_m_s2 = spread(survey.forces), survey.config.fused.side_threshold_m_s2
    if survey.flies:
        most_m_s2 = max(math.hypot(x, y) for x, y, _ in survey.forces)
        remedy = "balance or replace propellers, tighten motors, soften the mount; then `rebound tune` on this flight"
        found = (
            f"{shakes_m_s2:.2f} m/s^2 (RMS) hovering; sideways {most_m_s2:.1f} of {threshold_m_s2:g} that tell a hit"
        )
        yield judged("vibration", found, most_m_s2 >= threshold_m_s2, remedy)
    else:
        remedy = "let the vehicle stand still, motors off, and ask again"
        found = f"{shakes_m_s2:.2f} m/s^2 (RMS) while standing"
        yield judged("shaking", found, shakes_m_s2 > STANDS_M_S2, remedy)


def _time(survey: Preflight) -> PreflightItem:
    median_us, worst_us = survey.round_trip.median_us, survey.round_trip.worst_us
    if median_us is None or worst_us is None:
        return judged("time", "TIMESYNC is not answered", True, survey.vehicle.autopilot.remedy_no_time)
    found = f"{median_us / 1e3:.1f} ms there and back (median), {worst_us / 1e3:.1f} ms at worst"
    is_bad = median_us > MOST_TRIP_US
    quicker = "a wire instead of a radio; serial: baud rate 921600"
    remedy = "a wire or a direct link instead of this one" if is_bad else quicker
    return judged("time", found, median_us > DOUBTFUL_TRIP_US, remedy, is_bad)


def _battery(survey: Preflight) -> PreflightItem:
    percent = survey.vehicle.battery_percent
    if percent is None:
        return judged("battery", "unknown", True, survey.vehicle.autopilot.remedy_no_battery)
    return judged("battery", f"{percent} %", percent < DOUBTFUL_BATTERY, "charge it", percent < BAD_BATTERY)
