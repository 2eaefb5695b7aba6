"""Which message is due when: PX4's rule, which decides what a client really receives.

Source: PX4's mavlink/mavlink_stream.cpp (MavlinkStream::update), mavlink_main.cpp (the onboard link's
defaults, configure_stream) and mavlink_receiver.cpp (set_message_interval). Asked for 200 Hz, the rule
sends a 250 Hz topic at 125 Hz; asked for 100 Hz, in gaps of 12 and 8 ms.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from sim_vehicle.estimator.samples import FlowSample, RangeSample
from sim_vehicle.mavlink import aiding, encode
from sim_vehicle.mavlink.encode import Encoder, Message, Telemetry

# A message is sent this much before it is due: 0.3 of the link's loop, which sleeps 1.5 ms.
EARLY_US = 3 * (1500 // 10)
# Now and then the link's loop comes too late and misses one sample: PX4 asked for 250 Hz sends 246.
MISSED_LOOPS_SHARE = 0.012
# vehicle_status is published when it changes and at least at 2 Hz.
STATUS_PERIOD_US = 500_000
NOT_STREAMED_US = -1


class Topic(IntEnum):
    """Where a message's content comes from: without anything new there, nothing is sent."""

    ALWAYS_NEW = 0
    SAMPLE = 1
    POSITION = 2
    STATUS = 3
    FLOW = 4
    RANGE = 5
    TRUTH = 6


# What a vehicle may not have: nothing is sent of it before there is something.
OPTIONAL = (Topic.FLOW, Topic.RANGE, Topic.TRUTH)
_NEVER_SENT = -1


@dataclass(frozen=True, slots=True)
class StreamKind:
    """A message that can be streamed."""

    message_id: int
    default_hz: float | None
    topic: Topic
    build: Callable[[Telemetry], Message]

    @property
    def default_interval_us(self) -> int:
        """As configure_stream has it."""
        return NOT_STREAMED_US if self.default_hz is None else int(1_000_000 / self.default_hz)


HEARTBEAT_ID = 0

# In the order in which PX4 sends them: what needs low latency comes first.
KINDS: tuple[StreamKind, ...] = (
    StreamKind(HEARTBEAT_ID, 1.0, Topic.ALWAYS_NEW, encode.heartbeat),
    StreamKind(111, 10.0, Topic.ALWAYS_NEW, encode.timesync),
    StreamKind(105, 50.0, Topic.SAMPLE, encode.highres_imu),
    StreamKind(32, 30.0, Topic.POSITION, encode.local_position_ned),
    StreamKind(30, 100.0, Topic.SAMPLE, encode.attitude),
    StreamKind(331, 30.0, Topic.POSITION, encode.odometry),
    StreamKind(31, 50.0, Topic.SAMPLE, encode.attitude_quaternion),
    StreamKind(83, 10.0, Topic.POSITION, encode.attitude_target),
    StreamKind(132, 10.0, Topic.RANGE, aiding.distance_sensor),
    StreamKind(106, 10.0, Topic.FLOW, aiding.optical_flow_rad),
    StreamKind(436, 0.5, Topic.STATUS, encode.current_mode),
    StreamKind(245, 5.0, Topic.ALWAYS_NEW, encode.extended_sys_state),
    StreamKind(85, 10.0, Topic.POSITION, encode.position_target_local_ned),
    StreamKind(1, 5.0, Topic.SAMPLE, encode.sys_status),
    StreamKind(241, 0.5, Topic.SAMPLE, encode.vibration),
    StreamKind(148, None, Topic.ALWAYS_NEW, encode.autopilot_version),
    # The truth, as PX4's simulation has it too: for whoever studies a flight, on request alone.
    StreamKind(115, None, Topic.TRUTH, aiding.hil_state_quaternion),
)


def interval_from_request(interval_us: float) -> int:
    """The whole microseconds that PX4 makes of a requested interval by way of a rate, in 32-bit floats."""
    rate_hz = np.float32(1_000_000) / np.float32(interval_us)
    if not np.isfinite(rate_hz) or rate_hz <= 0.000001:
        return NOT_STREAMED_US
    return max(int(np.float32(1_000_000) / rate_hz), 1)


class Stream:
    """One running or stopped stream: due when `now_us > due_after_us`; then tell it that it was `sent`."""

    __slots__ = ("_last_us", "due_after_us", "interval_us", "kind", "seen")

    def __init__(self, kind: StreamKind, now_us: int) -> None:
        self.kind = kind
        self.seen = _NEVER_SENT
        self.restart(kind.default_interval_us, now_us)

    def restart(self, interval_us: int, now_us: int) -> None:
        """Begin anew, as a stream that was just created."""
        self._last_us = now_us
        self.set_interval(interval_us)

    def set_interval(self, interval_us: int) -> None:
        """Go on with another interval."""
        self.interval_us = interval_us
        self.due_after_us = self._last_us + interval_us - EARLY_US

    def sent(self, now_us: int) -> None:
        """Keep the mean rate by counting from when it was due, unless that is long ago."""
        interval_us = self.interval_us
        late = now_us - self._last_us >= 1.5 * interval_us
        self._last_us = now_us if late else self._last_us + interval_us
        self.due_after_us = self._last_us + interval_us - EARLY_US


class LateLoops:
    """The link's loop that now and then comes too late for a sample, which then nobody receives."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._missed_last = False

    def misses_this_one(self) -> bool:
        """Never two in a row: the gaps that were measured are of one sample."""
        missed = self._random.random() < MISSED_LOOPS_SHARE and not self._missed_last
        self._missed_last = missed
        return missed


class Streams:
    """All streams of the one link; packets wait in ``outbox`` until they are taken."""

    def __init__(self, state: Telemetry, encoder: Encoder, seed: int) -> None:
        self._state = state
        self._encoder = encoder
        self._now_us = state.sample.time_boot_us
        self._streams = [Stream(kind, self._now_us) for kind in KINDS]
        self._by_id = {stream.kind.message_id: stream for stream in self._streams}
        self._running = [stream for stream in self._streams if stream.interval_us >= 0]
        self._versions = [_NEVER_SENT if topic in OPTIONAL else 0 for topic in Topic]
        self._flow: FlowSample | None = None
        self._range: RangeSample | None = None
        self._status: tuple[int, bool, int] | None = None
        self._status_us = self._now_us
        self._loops = LateLoops(seed)
        self.outbox: list[bytes] = []

    def update(self, new_position: bool) -> None:
        """Send what is due at the newest sample; ``new_position``: the estimator has published."""
        self._now_us = now_us = self._state.sample.time_boot_us
        self._count_topics(now_us, new_position)
        if self._loops.misses_this_one():
            return
        versions, outbox = self._versions, self.outbox
        for stream in self._running:
            if now_us <= stream.due_after_us:
                continue
            kind = stream.kind
            version = versions[kind.topic]
            if version == stream.seen:
                continue
            stream.seen = version
            stream.sent(now_us)
            outbox.append(self._encoder.packet(kind.build(self._state)))

    def _count_topics(self, now_us: int, new_position: bool) -> None:
        versions = self._versions
        versions[0] += 1
        versions[1] += 1
        if new_position:
            versions[2] += 1
        state = self._state
        if state.flow is not self._flow:
            self._flow = state.flow
            versions[Topic.FLOW] += 1
        if state.range is not self._range:
            self._range = state.range
            versions[Topic.RANGE] += 1
        if state.true_body is not None:
            versions[Topic.TRUTH] += 1
        autopilot = state.autopilot
        status = (autopilot.modes.mode, autopilot.arming.armed, autopilot.system_status)
        if status != self._status or now_us - self._status_us >= STATUS_PERIOD_US:
            self._status, self._status_us = status, now_us
            versions[3] += 1

    # --- commands ----------------------------------------------------------------------------------------

    def set_interval(self, message_id: int, interval_us: float) -> bool:
        """SET_MESSAGE_INTERVAL; the heartbeat's cannot be changed."""
        stream = self._by_id.get(message_id)
        if stream is None or message_id == HEARTBEAT_ID:
            return False
        if interval_us < -0.00001:
            wanted_us = NOT_STREAMED_US
        elif interval_us > 0.00001:
            wanted_us = interval_from_request(interval_us)
        else:
            wanted_us = stream.kind.default_interval_us
        if stream.interval_us >= 0 and wanted_us >= 0:
            stream.set_interval(wanted_us)
        else:
            stream.restart(wanted_us, self._now_us)
        self._running = [stream for stream in self._streams if stream.interval_us >= 0]
        return True

    def announce_interval(self, message_id: int) -> None:
        """MESSAGE_INTERVAL: what was asked for, not what is received; -1 where nothing is streamed."""
        stream = self._by_id.get(message_id)
        interval_us = NOT_STREAMED_US if stream is None else stream.interval_us
        self.send(encode.message_interval(message_id, interval_us))

    def send_now(self, message_id: int) -> bool:
        """REQUEST_MESSAGE: as in PX4 nothing is sent that the stream has already sent."""
        stream = self._by_id.get(message_id)
        if stream is None:
            return False
        version = self._versions[stream.kind.topic]
        if stream.kind.topic is not Topic.ALWAYS_NEW and version == stream.seen:
            return False
        stream.seen = version
        self.send(stream.kind.build(self._state))
        return True

    def send(self, message: Message) -> None:
        """Send something that is no stream."""
        self.outbox.append(self._encoder.packet(message))

    def take(self) -> tuple[bytes, ...]:
        """All packets since the last call, in order."""
        packets = tuple(self.outbox)
        self.outbox.clear()
        return packets
