"""Which message is due when: PX4's rule, which decides what a client really receives.

Source: PX4's mavlink/mavlink_stream.cpp (MavlinkStream::update), mavlink_main.cpp (configure_stream) and
mavlink_receiver.cpp (set_message_interval). Asked for 200 Hz, the rule
sends a 250 Hz topic at 125 Hz; asked for 100 Hz, in gaps of 12 and 8 ms.
"""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from operator import ne

import numpy as np

from sim_vehicle.mavlink import encode
from sim_vehicle.mavlink.encode import Encoder, Message
from sim_vehicle.mavlink.streams import aiding, condition, navigation
from sim_vehicle.mavlink.streams.stream_rates import ON_REQUEST, UNLIMITED, LinkKind, Rates
from sim_vehicle.mavlink.streams.topics import NEVER_SENT, Topic, Topics
from sim_vehicle.mavlink.telemetry import Telemetry

NOT_STREAMED_US = -1
EVERY_TIME_US = 0
# PX4 counts in whole numbers of 32 bits.
_LONGEST_US = 2**31 - 1


@dataclass(frozen=True, slots=True)
class StreamKind:
    """A message that can be streamed."""

    message_id: int
    topic: Topic
    build: Callable[[Telemetry], Message | None]
    """None where there is nothing to say at the moment."""
    rates: Rates = ON_REQUEST
    """At which it is sent unasked."""
    notes: tuple[Topic, ...] = ()
    """Slower topics whose news the message marks as such: `Telemetry.renewed`, in this order."""


HEARTBEAT_ID = 0
# A message is sent up to 0.3 of the loop's sleep of 1.5 ms before it is due, as on SITL's fast links.
EARLY_US = 450
# Topics whose messages are sent on request even if they were sent already.
SENT_AGAIN = (Topic.ALWAYS_NEW, Topic.ORIGIN)

# In the order in which PX4 sends them: what needs low latency comes first.
KINDS: tuple[StreamKind, ...] = (
    StreamKind(HEARTBEAT_ID, Topic.ALWAYS_NEW, encode.heartbeat, Rates(1, 1, 1)),
    StreamKind(111, Topic.ALWAYS_NEW, encode.timesync, Rates(10, None, None)),
    StreamKind(105, Topic.SAMPLE, encode.highres_imu, Rates(50, None, None), notes=(Topic.MAGNETIC_FIELD, Topic.AIR)),
    StreamKind(32, Topic.POSITION, encode.local_position_ned, Rates(30, 1, 50)),
    StreamKind(30, Topic.SAMPLE, encode.attitude, Rates(100, 15, 50)),
    StreamKind(331, Topic.POSITION, encode.odometry, Rates(30, None, None)),
    StreamKind(31, Topic.SAMPLE, encode.attitude_quaternion, Rates(50, 10, 50)),
    StreamKind(83, Topic.POSITION, condition.attitude_target, Rates(10, 2, 50)),
    StreamKind(132, Topic.RANGE, aiding.distance_sensor, Rates(10, 0.5, 0.5)),
    StreamKind(106, Topic.FLOW, aiding.optical_flow_rad, Rates(10, None, 10)),
    StreamKind(436, Topic.STATUS, encode.current_mode, Rates(0.5, 0.5, 0.5)),
    StreamKind(245, Topic.ALWAYS_NEW, encode.extended_sys_state, Rates(5, 1, 1)),
    StreamKind(85, Topic.POSITION, encode.position_target_local_ned, Rates(10, 1.5, 50)),
    StreamKind(1, Topic.SAMPLE, condition.sys_status, Rates(5, 1, 1)),
    StreamKind(241, Topic.SAMPLE, encode.vibration, Rates(0.5, 0.1, 0.1)),
    StreamKind(148, Topic.ALWAYS_NEW, condition.autopilot_version),
    StreamKind(33, Topic.POSITION, navigation.global_position_int, Rates(50, 5, 50)),
    StreamKind(141, Topic.POSITION, navigation.altitude, Rates(10, 1, 1)),
    StreamKind(74, Topic.POSITION, navigation.vfr_hud, Rates(10, 4, 4)),
    StreamKind(36, Topic.SAMPLE, condition.servo_output_raw, Rates(10, 1, 50)),
    StreamKind(24, Topic.GPS, navigation.gps_raw_int, Rates(UNLIMITED, 5, 5)),
    StreamKind(230, Topic.POSITION, navigation.estimator_status, Rates(1, 0.5, 0.5)),
    StreamKind(49, Topic.ORIGIN, navigation.gps_global_origin, Rates(1, 1, 1)),
    StreamKind(242, Topic.ALWAYS_NEW, navigation.home_position, Rates(0.5, 0.5, 0.5)),
    StreamKind(147, Topic.BATTERY, condition.battery_status, Rates(0.5, 0.5, 0.5)),
    StreamKind(2, Topic.ALWAYS_NEW, condition.system_time, Rates(1, None, None)),
    StreamKind(4, Topic.ALWAYS_NEW, condition.ping, Rates(1, 0.1, 0.1)),
    StreamKind(69, Topic.STICKS, condition.manual_control),
    StreamKind(29, Topic.AIR, condition.scaled_pressure, Rates(1, 1, 1)),
    StreamKind(26, Topic.SAMPLE, condition.scaled_imu),
    StreamKind(264, Topic.ALWAYS_NEW, condition.flight_information),
)


def interval_from_rate(rate_hz: float | None) -> int:
    """As configure_stream has it; None stands for no stream, a negative rate for no limit."""
    if rate_hz is None:
        return NOT_STREAMED_US
    return EVERY_TIME_US if rate_hz < 0 else int(1_000_000 / rate_hz)


def interval_from_request(interval_us: float) -> int:
    """The whole microseconds that PX4 makes of a requested interval by way of a rate, in 32-bit floats."""
    rate_hz = np.float32(1_000_000) / np.float32(interval_us)
    if not np.isfinite(rate_hz) or rate_hz <= 0.000001:
        return NOT_STREAMED_US
    return min(max(int(np.float32(1_000_000) / rate_hz), 1), _LONGEST_US)


class Stream:
    """One running or stopped stream: due when `now_us > due_after_us`; then tell it that it was `sent`."""

    __slots__ = ("_last_us", "default_interval_us", "due_after_us", "interval_us", "kind", "noted", "seen", "topic")

    def __init__(self, kind: StreamKind, now_us: int, default_interval_us: int = NOT_STREAMED_US) -> None:
        self.kind, self.topic = kind, int(kind.topic)
        self.seen = NEVER_SENT
        self.noted = [NEVER_SENT for _ in kind.notes]
        self.default_interval_us = default_interval_us
        self.restart(default_interval_us, now_us)

    def restart(self, interval_us: int, now_us: int) -> None:
        """Restart with this interval, as a new stream."""
        self._last_us = now_us
        self.set_interval(interval_us)

    def set_interval(self, interval_us: int) -> None:
        """Go on with another interval."""
        self.interval_us = interval_us
        self.due_after_us = math.inf if interval_us < 0 else self._last_us + interval_us - EARLY_US

    def renewed(self, versions: list[int]) -> tuple[bool, ...]:
        """Which of the noted topics have news since the last message."""
        noted, self.noted = self.noted, list(map(versions.__getitem__, self.kind.notes))
        return tuple(map(ne, self.noted, noted))

    def sent(self, now_us: int) -> None:
        """Keep the mean rate by counting from when it was due, unless that is long ago."""
        interval_us = self.interval_us
        late = now_us - self._last_us >= 1.5 * interval_us
        self._last_us = now_us if late else self._last_us + interval_us
        self.due_after_us = self._last_us + interval_us - EARLY_US


# Now and then the link's loop comes too late and misses one sample: PX4 asked for 250 Hz sends 246.
MISSED_LOOPS_SHARE = 0.012


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
    """All streams of one link; their messages go to its ``encoder``."""

    def __init__(self, state: Telemetry, topics: Topics, encoder: Encoder, link: LinkKind, seed: int) -> None:
        self._state = state
        self._encoder = encoder
        now_us = state.sample.time_boot_us
        streams = (Stream(kind, now_us, interval_from_rate(kind.rates.on(link))) for kind in KINDS)
        self._by_id = {stream.kind.message_id: stream for stream in streams}
        self._versions = topics.versions
        self._loops = LateLoops(seed)

    def update(self) -> None:
        """Send what is due at the newest sample."""
        now_us = self._state.sample.time_boot_us
        if self._loops.misses_this_one():
            return
        versions = self._versions
        for stream in self._by_id.values():
            if now_us <= stream.due_after_us or stream.seen == versions[stream.topic]:
                continue
            stream.sent(now_us)
            self._send(stream)

    def _send(self, stream: Stream) -> bool:
        """Whether there was something to say."""
        versions, state = self._versions, self._state
        stream.seen = versions[stream.topic]
        if stream.kind.notes:
            state.renewed = stream.renewed(versions)
        message = stream.kind.build(state)
        if message is not None:
            self._encoder.send(message)
        return message is not None

    # --- commands ----------------------------------------------------------------------------------------

    def interval_us(self, message_id: int) -> int:
        """MESSAGE_INTERVAL's: -1 where nothing is sent and, as in PX4, where all that is new is."""
        stream = self._by_id.get(message_id)
        return NOT_STREAMED_US if stream is None else stream.interval_us or NOT_STREAMED_US

    def set_interval(self, message_id: int, interval_us: float) -> bool:
        """SET_MESSAGE_INTERVAL; the heartbeat's cannot be changed, and NaN means the rate at which a link begins."""
        stream = self._by_id.get(message_id)
        if stream is None or message_id == HEARTBEAT_ID:
            return False
        if interval_us < -0.00001:
            wanted_us = NOT_STREAMED_US
        elif interval_us > 0.00001:
            wanted_us = interval_from_request(interval_us)
        else:
            wanted_us = stream.default_interval_us
        if stream.interval_us >= 0 and wanted_us >= 0:
            stream.set_interval(wanted_us)
        else:
            stream.restart(wanted_us, self._state.sample.time_boot_us)
        return True

    def send_now(self, message_id: int) -> bool:
        """REQUEST_MESSAGE: as in PX4 nothing is sent that the stream has already sent, but the origin always."""
        stream = self._by_id.get(message_id)
        if stream is None:
            return False
        if stream.kind.topic not in SENT_AGAIN and self._versions[stream.topic] == stream.seen:
            return False
        return self._send(stream)
