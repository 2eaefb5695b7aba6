"""The aiding sensors' messages, filled as PX4's streams of those names fill them.

Source: PX4's mavlink/streams/OPTICAL_FLOW_RAD.hpp and DISTANCE_SENSOR.hpp.
"""

from collections.abc import Callable

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.estimator.samples import FlowSample, RangeSample
from sim_vehicle.mavlink.encode import Message
from sim_vehicle.mavlink.telemetry import Telemetry

_UNKNOWN_DISTANCE = -1.0
_LASER, _LOOKS_DOWN = dialect.MAV_DISTANCE_SENSOR_LASER, dialect.MAV_SENSOR_ROTATION_PITCH_270
_BAD_SIGNAL, _GOOD_SIGNAL = 1, 100
# LeddarOne's beam, as PX4's driver states it: 6 degrees.
_BEAM_RAD = 0.105
_UNKNOWN_VARIANCE = 255


def optical_flow_rad(state: Telemetry) -> Message:
    assert state.flow is not None, "streamed only once there is a sample"
    return _flow(dialect.MAVLink_optical_flow_rad_message, state.flow)


def hil_optical_flow(sample: FlowSample) -> Message:
    """The same sample for PX4's simulator port."""
    return _flow(dialect.MAVLink_hil_optical_flow_message, sample)


def _flow(kind: Callable[..., Message], sample: FlowSample) -> Message:
    """The distance goes in a DISTANCE_SENSOR of its own."""
    seen = (*sample.flow_frd_rad, *sample.gyroscope_frd_rad)
    return kind(sample.time_us, 0, sample.integration_us, *seen, 0, sample.quality, 0, _UNKNOWN_DISTANCE)


def distance_sensor(state: Telemetry) -> Message:
    assert state.range is not None, "streamed only once there is a sample"
    return distance_looking_down(state.range)


def distance_looking_down(sample: RangeSample) -> Message:
    """In whole centimetres; what was not seen is one beyond the greatest, with a bad signal."""
    least_cm, most_cm = round(100 * sample.distance_min_m), round(100 * sample.distance_max_m)
    seen = sample.distance_m is not None
    return dialect.MAVLink_distance_sensor_message(
        (sample.time_us // 1000) & 0xFFFFFFFF,
        least_cm,
        most_cm,
        most_cm + 1 if sample.distance_m is None else round(100 * sample.distance_m),
        _LASER,
        0,
        _LOOKS_DOWN,
        _UNKNOWN_VARIANCE,
        _BEAM_RAD,
        _BEAM_RAD,
        (0.0, 0.0, 0.0, 0.0),
        _GOOD_SIGNAL if seen else _BAD_SIGNAL,
    )
