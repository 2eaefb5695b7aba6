"""What a companion hears of a recorded stretch: the typed samples that PX4's link would deliver, without the bytes.

The link's own rule decides what is sent when; numbers have the width of their MAVLink fields. A test holds this
against the whole wire, bytes included.
"""

import math
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from companion.messages import (
    Attitude,
    AttitudeTarget,
    ExtendedState,
    ImuSample,
    LandedState,
    LocalPosition,
    MessageId,
    Odometry,
    Sample,
    Vibration,
)
from companion.reflex.detector import Situation
from sim_vehicle.autopilot.autopilot import POSITION_PERIOD_US
from sim_vehicle.faults.spec import WireFault
from sim_vehicle.faults.wire import Wire as FaultyWire
from sim_vehicle.mavlink import vibration
from sim_vehicle.mavlink.streams.streams import KINDS, LateLoops, Stream, interval_from_request
from sim_vehicle.mavlink.streams.topics import Topic
from sim_vehicle.mavlink.telemetry import quaternion_from_matrix
from sim_vehicle.physics.layout import HIT_IMPULSE, HIT_START_US
from sim_vehicle.plant.plant import Plant, PlantOutput

Floats = npt.NDArray[np.float64]
Vector3 = tuple[float, float, float]
Builder = Callable[[int], Sample]
FOUR_FLOATS = struct.Struct("<4f")
# Wi-Fi with others on the channel: up to 10 ms of waiting for the air, now and then a packet gone or overtaken.
JITTERY: Final = "jitter 10 ms, 1 % lost, 1 % overtaken"
LINKS: dict[str, WireFault] = {
    JITTERY: WireFault(kind="wire", at_s=0.0, jitter_s=0.01, loss=0.01, reorder=0.01),
}
# The companion hears a packet when it arrives; finer than an IMU interval of 4 ms, or latencies came in steps of it.
LOOK_EVERY_US = 1000
_NUMBER_BYTES = 4


@dataclass(slots=True)
class VehicleRecording:
    """One entry an interval in each list. `published` is the state estimate as of 8 ms, as PX4 publishes it."""

    samples: list[PlantOutput] = field(default_factory=list)
    published: list[PlantOutput] = field(default_factory=list)
    asked_attitudes: list[list[list[float]]] = field(default_factory=list)
    """Rotation matrices that the position control asked for."""
    situations: list[Situation] = field(default_factory=list)
    contact_m_s2: list[float] = field(default_factory=list)
    """The obstacles' mean force on the vehicle over the interval, per unit mass. The ground's is not in it."""
    _state: tuple[Floats, Floats] | None = None
    """Views of the plant's state, taken once: looking a field up costs microseconds."""
    _impulse: tuple[float, Vector3] = (0.0, (0.0, 0.0, 0.0))

    def add(self, plant: Plant, sample: PlantOutput, situation: Situation, mass_kg: float) -> None:
        """Take an interval that the plant has just advanced by."""
        latest = self.published[-1] if self.published else sample
        is_due = sample.time_boot_us - latest.time_boot_us >= POSITION_PERIOD_US
        self.samples.append(sample)
        self.published.append(sample if is_due else latest)
        if self._state is None:
            self._state = plant.state.hit, plant.state.attitude_setpoint
        self.asked_attitudes.append(self._state[1].tolist())
        self.situations.append(situation)
        self.contact_m_s2.append(self._contact_n_s(self._state[0]) / (mass_kg * 1e-6 * plant.interval_us))

    def _contact_n_s(self, hit: Floats) -> float:
        """Size of the impulse that the obstacles gave in the latest interval."""
        started_us = float(hit[HIT_START_US])
        if started_us == 0.0:
            return 0.0
        x, y, z = hit[HIT_IMPULSE].tolist()
        before = self._impulse[1] if started_us == self._impulse[0] else (0.0, 0.0, 0.0)
        self._impulse = (started_us, (x, y, z))
        return math.dist((x, y, z), before)


@dataclass(frozen=True, slots=True)
class HeardStep:
    """The samples that come in with one of the link's loops; `index` is the recording's interval."""

    index: int
    time_boot_us: int
    samples: tuple[Sample, ...]


class Wire:
    """The link of a recorded vehicle; `heard` any number of times, at other rates."""

    def __init__(self, recording: VehicleRecording) -> None:
        self._recording = recording
        self._builders: dict[MessageId, Builder] = {}

    def heard(self, asked_hz: Mapping[MessageId, float], seed: int) -> list[HeardStep]:
        """All that arrives on a link that is asked for these rates when the recording begins."""
        samples, published = self._recording.samples, self._recording.published
        kinds = [kind for kind in KINDS if kind.message_id in asked_hz]
        streams = [Stream(kind, samples[0].time_boot_us) for kind in kinds]
        for stream in streams:
            stream.set_interval(interval_from_request(1e6 / asked_hz[MessageId(stream.kind.message_id)]))
        rows = [
            (stream, kind.topic is Topic.POSITION, self._builder(MessageId(kind.message_id)))
            for stream, kind in zip(streams, kinds, strict=True)
        ]
        loops = LateLoops(seed)
        arrived = []
        # The first interval is there before anybody asks.
        for index in range(1, len(samples)):
            if loops.misses_this_one():
                continue
            now_us, due = samples[index].time_boot_us, []
            for stream, waits_for_position, build in rows:
                if now_us <= stream.due_after_us:
                    continue
                version = published[index].time_boot_us if waits_for_position else now_us
                if version == stream.seen:
                    continue
                stream.seen = version
                stream.sent(now_us)
                due.append(build(index))
            if due:
                arrived.append(HeardStep(index, now_us, tuple(due)))
        return arrived

    def _builder(self, message: MessageId) -> "Builder":
        if message not in self._builders:
            self._builders[message] = BUILDERS[message](self._recording)
        return self._builders[message]


def _as_floats(rows: Iterable[Sequence[float]]) -> list[Any]:
    """Tuples of numbers as a MAVLink float carries them."""
    return [tuple(row) for row in np.array(list(rows), np.float32).astype(np.float64).tolist()]


def _milliseconds(sample: PlantOutput) -> int:
    """Time in microseconds as `time_boot_ms` leaves it."""
    return sample.time_boot_us // 1000 * 1000


def _imu(recording: VehicleRecording) -> Builder:
    samples = recording.samples
    rows = _as_floats((*s.specific_force_frd_m_s2, *s.angular_velocity_frd_rad_s) for s in samples)
    return lambda index: ImuSample(samples[index].time_boot_us, rows[index][:3], rows[index][3:])


def _local_position(recording: VehicleRecording) -> Builder:
    published = recording.published
    rows = _as_floats((*s.position_ned_m, *s.velocity_ned_m_s) for s in published)
    return lambda index: LocalPosition(_milliseconds(published[index]), rows[index][:3], rows[index][3:])


def _odometry(recording: VehicleRecording) -> Builder:
    published = recording.published
    rows = _as_floats((*s.position_ned_m, *s.velocity_ned_m_s) for s in published)

    def build(index: int) -> Sample:
        estimate = published[index]
        return Odometry(estimate.time_boot_us, rows[index][:3], rows[index][3:], estimate.reset_counter & 0xFF)

    return build


def _attitude(recording: VehicleRecording) -> Builder:
    samples = recording.samples
    rows = _as_floats((*s.attitude_wxyz, *s.angular_velocity_frd_rad_s) for s in samples)
    return lambda index: Attitude(_milliseconds(samples[index]), rows[index][:4], rows[index][4:])


def _attitude_target(recording: VehicleRecording) -> Builder:
    samples, rows = recording.samples, _as_floats((s.thrust_fraction,) for s in recording.samples)

    def build(index: int) -> Sample:
        asked = quaternion_from_matrix(recording.asked_attitudes[index])
        w, x, y, z = FOUR_FLOATS.unpack(FOUR_FLOATS.pack(*asked))
        return AttitudeTarget(_milliseconds(samples[index]), rows[index][0], (w, x, y, z))

    return build


def _vibration(recording: VehicleRecording) -> Builder:
    samples, metrics, levels = recording.samples, vibration.VibrationMetrics(), [(0.0, 0.0)]
    for sample in samples[1:]:
        metrics.update(sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s)
        levels.append((metrics.gyroscope_rad_s, metrics.accelerometer_m_s2))
    rows = _as_floats(levels)

    def build(index: int) -> Sample:
        clipped = sum(samples[index].clipping_counts)
        return Vibration(samples[index].time_boot_us, rows[index][0], rows[index][1], (clipped, 0, 0))

    return build


def _extended_state(recording: VehicleRecording) -> Builder:
    return lambda index: ExtendedState(LandedState(recording.situations[index].landed_state))


def over_link(sent: Sequence[HeardStep], recording: VehicleRecording, fault: WireFault, seed: int) -> list[HeardStep]:
    """What arrives, and when, of the samples that were sent: each message a packet of its own.

    `index` is the interval of the arrival, whose situation the companion knows then.
    """
    wire = FaultyWire([fault], seed)
    packets: list[Sample] = []
    sent_at = {step.index: step.samples for step in sent}
    arrived: list[HeardStep] = []
    times_us = [sample.time_boot_us for sample in recording.samples]
    ends_us = [*times_us[1:], times_us[-1] + LOOK_EVERY_US]
    for index, (begins_us, end_us) in enumerate(zip(times_us, ends_us, strict=True)):
        frames = []
        for sample in sent_at.get(index, ()):
            frames.append(len(packets).to_bytes(_NUMBER_BYTES, "little"))
            packets.append(sample)
        for now_us in range(begins_us, end_us, LOOK_EVERY_US):
            numbers = wire.carry(frames, now_us)
            frames = []
            if numbers:
                samples = tuple(packets[int.from_bytes(number, "little")] for number in numbers)
                arrived.append(HeardStep(index, now_us, samples))
    return arrived


BUILDERS: dict[MessageId, Callable[[VehicleRecording], Builder]] = {
    MessageId.HIGHRES_IMU: _imu,
    MessageId.LOCAL_POSITION_NED: _local_position,
    MessageId.ODOMETRY: _odometry,
    MessageId.ATTITUDE_QUATERNION: _attitude,
    MessageId.ATTITUDE_TARGET: _attitude_target,
    MessageId.VIBRATION: _vibration,
    MessageId.EXTENDED_SYS_STATE: _extended_state,
}
