"""What a companion hears of a recorded stretch: the typed samples that PX4's link would deliver, without the bytes.

The link's own rule decides what is sent when; numbers have the width of their MAVLink fields. A test holds this
against the whole wire, bytes included.
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.detectors.recording import VehicleRecording
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
from sim_vehicle.mavlink import vibration
from sim_vehicle.mavlink.streams.streams import KINDS, LateLoops, Stream, interval_from_request
from sim_vehicle.mavlink.streams.topics import Topic
from sim_vehicle.mavlink.telemetry import quaternion_from_matrix
from sim_vehicle.plant.plant import PlantOutput


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


Builder = Callable[[int], Sample]
FOUR_FLOATS = struct.Struct("<4f")


def _as_floats(rows: Sequence[Sequence[float]]) -> list[list[float]]:
    """Numbers as a MAVLink float carries them."""
    narrow: list[list[float]] = np.array(rows, np.float32).astype(np.float64).tolist()
    return narrow


def _milliseconds(sample: PlantOutput) -> int:
    """Time in microseconds as `time_boot_ms` leaves it."""
    return sample.time_boot_us // 1000 * 1000


def _imu(recording: VehicleRecording) -> Builder:
    samples = recording.samples
    rows = _as_floats([(*s.specific_force_frd_m_s2, *s.angular_velocity_frd_rad_s) for s in samples])

    def build(index: int) -> Sample:
        a, b, c, p, q, r = rows[index]
        return ImuSample(samples[index].time_boot_us, (a, b, c), (p, q, r))

    return build


def _local_position(recording: VehicleRecording) -> Builder:
    published = recording.published
    rows = _as_floats([(*s.position_ned_m, *s.velocity_ned_m_s) for s in published])

    def build(index: int) -> Sample:
        x, y, z, u, v, w = rows[index]
        return LocalPosition(_milliseconds(published[index]), (x, y, z), (u, v, w))

    return build


def _odometry(recording: VehicleRecording) -> Builder:
    published = recording.published
    rows = _as_floats([(*s.position_ned_m, *s.velocity_ned_m_s) for s in published])

    def build(index: int) -> Sample:
        x, y, z, u, v, w = rows[index]
        estimate = published[index]
        return Odometry(estimate.time_boot_us, (x, y, z), (u, v, w), estimate.reset_counter & 0xFF)

    return build


def _attitude(recording: VehicleRecording) -> Builder:
    samples = recording.samples
    rows = _as_floats([(*s.attitude_wxyz, *s.angular_velocity_frd_rad_s) for s in samples])

    def build(index: int) -> Sample:
        w, x, y, z, p, q, r = rows[index]
        return Attitude(_milliseconds(samples[index]), (w, x, y, z), (p, q, r))

    return build


def _attitude_target(recording: VehicleRecording) -> Builder:
    samples = recording.samples
    rows = _as_floats([(s.thrust_fraction,) for s in samples])

    def build(index: int) -> Sample:
        asked = quaternion_from_matrix(recording.asked_attitudes[index])
        w, x, y, z = FOUR_FLOATS.unpack(FOUR_FLOATS.pack(*asked))
        return AttitudeTarget(_milliseconds(samples[index]), rows[index][0], (w, x, y, z))

    return build


def _vibration(recording: VehicleRecording) -> Builder:
    samples, metrics, levels = recording.samples, vibration.VibrationMetrics(), []
    for sample in samples[1:]:
        metrics.update(sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s)
        levels.append((metrics.gyroscope_rad_s, metrics.accelerometer_m_s2))
    rows = _as_floats([(0.0, 0.0), *levels])

    def build(index: int) -> Sample:
        clipped = sum(samples[index].clipping_counts)
        return Vibration(samples[index].time_boot_us, rows[index][0], rows[index][1], (clipped, 0, 0))

    return build


def _extended_state(recording: VehicleRecording) -> Builder:
    situations = recording.situations

    def build(index: int) -> Sample:
        return ExtendedState(LandedState(situations[index].landed_state))

    return build


BUILDERS: dict[MessageId, Callable[[VehicleRecording], Builder]] = {
    MessageId.HIGHRES_IMU: _imu,
    MessageId.LOCAL_POSITION_NED: _local_position,
    MessageId.ODOMETRY: _odometry,
    MessageId.ATTITUDE_QUATERNION: _attitude,
    MessageId.ATTITUDE_TARGET: _attitude_target,
    MessageId.VIBRATION: _vibration,
    MessageId.EXTENDED_SYS_STATE: _extended_state,
}
