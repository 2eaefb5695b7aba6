"""The streams that the companion requests, and their measured rates."""

from collections.abc import Collection
from dataclasses import dataclass

from companion import messages
from companion.autopilot.interface import Autopilot
from companion.messages import LocalPosition, MessageId
from companion.mission.config import StreamsConfig


@dataclass(frozen=True, slots=True)
class RequestedStream:
    """A wanted stream; a flight does not begin below `min_hz`."""

    message_id: MessageId
    sample_type: type
    asked_hz: float
    min_hz: float

    def request(self) -> messages.VehicleCommand:
        return messages.set_message_interval(self.message_id, round(1e6 / self.asked_hz))


def wanted_streams(config: StreamsConfig, for_detector: Collection[MessageId]) -> tuple[RequestedStream, ...]:
    """All streams to request. Mode and landed state are optional: HEARTBEAT has the mode, too, more slowly.

    The detector's additional streams are optional, too: it reports what it loses without them.
    """
    always = (
        RequestedStream(MessageId.HIGHRES_IMU, messages.ImuSample, config.highres_imu_hz, config.min_highres_imu_hz),
        RequestedStream(
            MessageId.LOCAL_POSITION_NED, LocalPosition, config.local_position_hz, config.min_local_position_hz
        ),
        RequestedStream(MessageId.ATTITUDE_QUATERNION, messages.Attitude, config.attitude_hz, config.min_attitude_hz),
        RequestedStream(MessageId.EXTENDED_SYS_STATE, messages.ExtendedState, config.extended_sys_state_hz, 0.0),
        RequestedStream(MessageId.CURRENT_MODE, messages.CurrentMode, config.current_mode_hz, 0.0),
        RequestedStream(MessageId.GPS_RAW_INT, messages.GpsFix, config.gps_raw_int_hz, 0.0),
    )
    wished = (
        RequestedStream(MessageId.ATTITUDE_TARGET, messages.AttitudeTarget, config.attitude_target_hz, 0.0),
        RequestedStream(MessageId.ODOMETRY, messages.Odometry, config.odometry_hz, 0.0),
        RequestedStream(MessageId.VIBRATION, messages.Vibration, config.vibration_hz, 0.0),
    )
    return always + tuple(stream for stream in wished if stream.message_id in for_detector)


class StreamMonitor:
    """Counts received messages. Rates are means over the companion's time, so lost packets lower them."""

    def __init__(self, config: StreamsConfig, for_detector: Collection[MessageId] = ()) -> None:
        self.streams = wanted_streams(config, for_detector)
        self.asked: dict[float, messages.VehicleCommand] = {}  # by message, and what stands in for one, too
        self._counts: dict[type, int] = {stream.sample_type: 0 for stream in self.streams}
        self.started_us: int | None = None  # unset: nothing is counted yet
        self._until_us = 0

    def count(self, sample_type: type, now_us: int) -> None:
        if self.started_us is not None and sample_type in self._counts:
            self._counts[sample_type] += 1
            self._until_us = now_us

    def start(self, now_us: int) -> None:
        """Begin to measure, from nothing."""
        self._counts = dict.fromkeys(self._counts, 0)
        self.started_us = self._until_us = now_us

    def rates_hz(self) -> dict[str, float]:
        """Mean rates since the start, until something last arrived."""
        if self.started_us is None or self._until_us <= self.started_us:
            return {}
        seconds = (self._until_us - self.started_us) * 1e-6
        return {s.message_id.name: round(self._counts[s.sample_type] / seconds, 2) for s in self.streams}

    def too_slow(self, autopilot: Autopilot) -> str | None:
        """One sentence on the first stream that is below its least rate, or None."""
        rates = self.rates_hz()
        for stream in self.streams:
            rate_hz = rates.get(stream.message_id.name, 0.0)
            if rate_hz < stream.min_hz:
                if rate_hz == 0.0 and stream.sample_type is LocalPosition:
                    return (
                        "the vehicle has no position: LOCAL_POSITION_NED does not arrive; wait for GPS, flow or motion "
                        "capture, and read its arming checks"
                    )
                return (
                    f"{stream.message_id.name} arrives at {rate_hz:.1f} Hz and at least {stream.min_hz:g} Hz are "
                    f"needed; give the link more bandwidth (baud rate, {autopilot.rate_parameter}) or check the "
                    "vehicle's estimate"
                )
        return None
