"""PX4's own logs (.ulg) as the samples that its MAVLink link would have carried; pyulog reads the file.

The conversions are those of PX4's mavlink/streams (HIGHRES_IMU, LOCAL_POSITION_NED, ODOMETRY, ATTITUDE_QUATERNION,
ATTITUDE_TARGET, EXTENDED_SYS_STATE, HEARTBEAT). A log holds most topics at lower rates than the wire
would, and which it holds differs from version to version (v1.11 to v1.16 and later): what is not there is said.
"""

import contextlib
import io
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pyulog import ULog

from companion import messages
from companion.link.vehicle import MULTICOPTERS
from rebound_cli.logs.log import (
    QUADROTOR,
    Log,
    LogError,
    LoggedSample,
    heartbeat,
    in_order,
    multicopter,
    position_target,
    slow_velocity,
    vector,
)
from rebound_cli.logs.topic import Floats, Topic

_NAMES = [
    *("sensor_combined", "vehicle_imu", "estimator_sensor_bias", "estimator_selector_status"),
    *("vehicle_local_position", "vehicle_attitude", "vehicle_attitude_setpoint", "vehicle_status"),
    *("vehicle_land_detected", "vehicle_control_mode", "position_setpoint_triplet", "trajectory_setpoint"),
    "vehicle_local_position_setpoint",
]
# What a missing topic costs, in the words of docs/how-to/recorded-flights.md.
_COSTS = {
    "vehicle_local_position": "height and velocity are not known: no v_c, and landings are told by the land detector",
    "vehicle_attitude": "the direction of a hit in the world is not known",
    "vehicle_attitude_setpoint": "thrust is not known: hits along body z are judged by the force's own change alone",
    "vehicle_land_detected": "landed or not is not known: a touchdown can look like a hit",
    "vehicle_status": "armed or not is not known: the whole log is taken for a flight",
}
# A topic that begins this much later than the IMU samples was not there when something may have happened.
_LATE_US = 1_000_000
# Every ULog message begins with its size and its type.
_HEADER_SIZE = 3

# vehicle_status.arming_state, the same number since 2015; position_setpoint.type.
_ARMED, _TAKEOFF, _LAND = 2, 3, 4
# MAV_TYPE of a VTOL that does not say which, and of what vehicle_status.vehicle_type counts beside rotary wings: fixed
# wings and rovers.
_VTOL, _OTHER_TYPES = 19, {2: 1, 3: 10}
# vehicle_status.nav_state to the parts of HEARTBEAT.custom_mode (px4_custom_mode.h, get_px4_custom_mode): main modes
# MANUAL 1, ALTCTL 2, POSCTL 3, ACRO 5, OFFBOARD 6, STABILIZED 7, ALTITUDE_CRUISE 11; under AUTO 4 TAKEOFF 2, LOITER 3,
# MISSION 4, RTL 5, LAND 6, FOLLOW 8, PRECLAND 9, VTOL_TAKEOFF 10, EXTERNAL1 to 8 from 11 on; under POSCTL ORBIT 1,
# SLOW 2. DESCEND (12) shows as LAND, TERMINATION (13) as MANUAL, as until v1.14.
_MAIN = {0: 1, 1: 2, 2: 3, 8: 11, 10: 5, 13: 1, 14: 6, 15: 7}
_AUTO = {3: 4, 4: 3, 5: 5, 12: 6, 17: 2, 18: 6, 19: 8, 20: 9, 22: 10} | {state: state - 12 for state in range(23, 31)}
_MODES = {state: main << 16 for state, main in _MAIN.items()} | {21: 3 << 16 | 1 << 24, 6: 3 << 16 | 2 << 24}
_MODES |= {state: 4 << 16 | sub << 24 for state, sub in _AUTO.items()}

_Topics = Mapping[tuple[str, int], Topic]


class _Content(io.BytesIO):
    """A file in memory. Where its end cuts a message of the head, pyulog would go back and read it again for ever."""

    _message_at = 0

    def read(self, size: int | None = -1, /) -> bytes:
        if size == _HEADER_SIZE:
            self._message_at = self.tell()
        return super().read(size)

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        if whence == io.SEEK_CUR and self.tell() + offset < self._message_at:
            raise EOFError("it is cut short")
        return super().seek(offset, whence)


def read_ulog(path: Path) -> Log:
    """Raises LogError."""
    content = _Content(path.read_bytes())
    try:
        # It prints its warnings; what they say is asked for below.
        with contextlib.redirect_stdout(io.StringIO()):
            log = ULog(content, _NAMES)
    except Exception as error:  # damaged files make it raise whatever the bytes led to
        raise LogError(f"{path}: not a readable PX4 log: {error or type(error).__name__}.") from error
    topics = dict.fromkeys([(name, 0) for name in _NAMES], Topic({"timestamp": np.array([])}))
    topics |= {
        (data.name, data.multi_id): Topic(data.data) for data in log.data_list if len(data.data.get("timestamp", ()))
    }
    # The faster of the two: by default sensor_combined is logged whole and vehicle_imu twice a second.
    inertial = [topic for name in ("vehicle_imu", "sensor_combined") if (topic := topics[name, 0])]
    if not inertial:
        text = "neither sensor_combined nor vehicle_imu in it; PX4 logs them by default (SDLOG_PROFILE)"
        raise LogError(f"{path}: {text}.")
    imu = max(inertial, key=Topic.rate_hz)
    parameters = {k: float(v) for k, v in log.initial_parameters.items() if isinstance(v, int | float)}
    _check_multicopter(path, topics["vehicle_status", 0], parameters)
    heard = [
        *_imu_samples(topics, imu),
        *_local_position(topics["vehicle_local_position", 0]),
        *_attitude(topics["vehicle_attitude", 0]),
        *_attitude_target(topics["vehicle_attitude_setpoint", 0]),
        *_heartbeat(topics["vehicle_status", 0]),
        *_demand(topics["trajectory_setpoint", 0] or topics["vehicle_local_position_setpoint", 0]),
        *_landed_states(topics),
    ]
    clipped, intervals = imu.column(*_CLIPPING), imu.column("accelerometer_integral_dt", "delta_velocity_dt")
    return Log(
        path=path,
        vehicle=_name(log),
        # Instants that topics share; a log's own start may lie hours of waiting before its data.
        started_at_us=int(log.start_timestamp),
        heard=in_order(heard, float(np.median(imu.time_us))),
        losses=tuple(_losses(log, topics, imu)),
        clipped_at_us=None if clipped is None else tuple(imu.time_us[clipped > 0].tolist()),
        # A driver that reads its sensor in blocks makes some of them longer.
        averaging_us=None if intervals is None else float(np.percentile(intervals, 99)),
    )


def _name(log: ULog) -> str:
    hardware, release = log.msg_info_dict.get("ver_hw"), log.msg_info_dict.get("ver_sw_release")
    version = f" {release >> 24 & 255}.{release >> 16 & 255}.{release >> 8 & 255}" if isinstance(release, int) else ""
    return f"PX4{version}{f' on {hardware}' if hardware else ''}"


def _check_multicopter(path: Path, status: Topic, parameters: Mapping[str, float]) -> None:
    """Raise LogError where the vehicle is no multicopter by its MAV_TYPE."""
    said, kind_of_wing, vtol = (status.column(field) for field in ("system_type", "vehicle_type", "is_vtol"))
    # A parameter counts where the vehicle's own status holds no type; 0 says nothing.
    kinds = [
        int(parameters.get("MAV_TYPE", 0) if said is None else said[-1]),
        0 if kind_of_wing is None else _OTHER_TYPES.get(int(kind_of_wing[-1]), 0),
        _VTOL if vtol is not None and vtol.all() else 0,
    ]
    kind = next((kind for kind in kinds if kind and kind not in MULTICOPTERS), max(kinds) or QUADROTOR)
    multicopter(path, kind)


def _losses(log: ULog, topics: _Topics, imu: Topic) -> Iterator[str]:
    if log.file_corruption:
        yield "the file is damaged in places: samples are missing there"
    if (lost_s := sum(dropout.duration for dropout in log.dropouts) * 1e-3) > 0:
        yield f"the logger dropped {lost_s:.2f} s of data: nothing is seen there"
    for name, cost in _COSTS.items():
        topic = topics[name, 0]
        if not topic:
            yield f"no {name}: {cost}"
        elif topic.time_us[0] - imu.time_us[0] > _LATE_US:
            yield f"no {name} before {(topic.time_us[0] - log.start_timestamp) * 1e-6:.1f} s: until then {cost}"
    if position := topics["vehicle_local_position", 0]:
        yield from slow_velocity("vehicle_local_position", position.rate_hz())
        for flag, what in (("v_xy_valid", "horizontal velocity"), ("v_z_valid", "vertical velocity")):
            valid = position.column(flag)
            if valid is not None and not valid.all():
                share = 100 * (1 - float(valid.mean()))
                yield f"the {what} is invalid by the estimator's own word for {share:.0f} % of the log: so is v_c"
    if imu.column(*_CLIPPING) is None:
        yield "no clipping flags in this version: clipped peaks are told by their size alone"


# When a raw reading inside a sample was at the end of the sensor's range.
_CLIPPING = ("accelerometer_clipping", "delta_velocity_clipping")


def _imu_samples(topics: _Topics, imu: Topic) -> Iterator[LoggedSample]:
    """Mean specific force and angular rate over each integration interval, less the estimator's biases."""
    force, turning, taken_us = imu.array("accelerometer_m_s2"), imu.array("gyro_rad"), None
    if force is None:
        # vehicle_imu holds increments and how long they took, in microseconds.
        velocity, velocity_us = imu.array("delta_velocity"), imu.vector("delta_velocity_dt")
        angle, angle_us = imu.array("delta_angle"), imu.vector("delta_angle_dt")
        if velocity is None or velocity_us is None or angle is None or angle_us is None:
            return
        with np.errstate(divide="ignore", invalid="ignore"):
            force, turning = velocity / (velocity_us * 1e-6), angle / (angle_us * 1e-6)
        taken_us = imu.column("timestamp_sample")
    if turning is None:
        return
    biases = [_bias(topics, sensor, imu.time_us) for sensor in ("accel", "gyro")]
    for index, time_us, row in imu.rows(np.column_stack([force, turning]) - np.column_stack(biases)):
        sample_us = time_us if taken_us is None else int(taken_us[index])
        yield LoggedSample(time_us, messages.ImuSample(sample_us, vector(row), vector(row[3:])))


def _bias(topics: _Topics, sensor: str, at_us: npt.NDArray[np.int64]) -> Floats:
    """What the primary estimator held the bias for at each time; zero where it is not logged."""
    biases, primary = np.zeros((len(at_us), 3)), np.zeros(len(at_us))
    selector = topics["estimator_selector_status", 0]
    if (chosen := selector.column("primary_instance")) is not None:
        primary, _ = selector.held(chosen, at_us)
    names = sorted(key for key, topic in topics.items() if key[0] == "estimator_sensor_bias" and topic)
    for instance, topic in enumerate(topics[name] for name in names):
        values, device = topic.array(f"{sensor}_bias"), topic.vector(f"{sensor}_device_id")
        if values is not None:
            held, is_known = topic.held(values if device is None else np.where(device > 0, values, 0.0), at_us)
            biases = np.where((primary == instance)[:, None], np.where(is_known[:, None], held, 0.0), biases)
    return biases


def _ms(time_us: int) -> int:
    """A message's stamp in milliseconds cuts what is less."""
    return time_us // 1000 * 1000


def _local_position(topic: Topic) -> Iterator[LoggedSample]:
    """LOCAL_POSITION_NED and, where the version counts its jumps, ODOMETRY: the wire sends both, valid or not."""
    columns = [topic.column(f"{name}_reset_counter") for name in ("xy", "z", "vxy", "vz")]
    counters = [column for column in columns if column is not None]
    resets = np.sum(counters, axis=0) if counters else None
    for index, time_us, row in topic.rows(topic.vector("x", "y", "z", "vx", "vy", "vz")):
        position, velocity = vector(row), vector(row[3:])
        yield LoggedSample(time_us, messages.LocalPosition(_ms(time_us), position, velocity))
        if resets is not None:
            yield LoggedSample(time_us, messages.Odometry(time_us, position, velocity, int(resets[index]) % 256))


def _attitude(topic: Topic) -> Iterator[LoggedSample]:
    rates = topic.vector("rollspeed", "pitchspeed", "yawspeed")  # until v1.11
    for index, time_us, (w, x, y, z) in topic.rows(topic.array("q", 4)):
        turning = None if rates is None else vector(rates[index].tolist())
        yield LoggedSample(time_us, messages.Attitude(_ms(time_us), (w, x, y, z), turning))


def _attitude_target(topic: Topic) -> Iterator[LoggedSample]:
    attitudes = topic.array("q_d", 4)
    for index, time_us, thrust in topic.rows(topic.array("thrust_body")):
        w, x, y, z = [math.nan] * 4 if attitudes is None else attitudes[index].tolist()
        attitude = (w, x, y, z) if math.isfinite(w + x + y + z) else None
        yield LoggedSample(time_us, messages.AttitudeTarget(_ms(time_us), math.hypot(*thrust), attitude))


def _heartbeat(topic: Topic) -> Iterator[LoggedSample]:
    arming, none = topic.column("arming_state"), np.full(len(topic), -1.0)
    if arming is None:
        return
    columns = [none if (c := topic.column(n)) is None else c for n in ("nav_state", "failsafe", "system_type")]
    for time_us, arm, state, acts, kind in zip(topic.time_us.tolist(), arming, *columns, strict=True):
        kind = int(kind) if int(kind) in MULTICOPTERS else QUADROTOR
        yield LoggedSample(time_us, heartbeat(kind, bool(arm == _ARMED), _MODES.get(int(state), 0), acts > 0))


def _demand(topic: Topic) -> Iterator[LoggedSample]:
    """Fields are x, y, z, vx, ... until v1.13 and position[], velocity[] since; NaN where nothing is asked."""
    positions, velocities = topic.array("position"), topic.array("velocity")
    if positions is None or velocities is None:
        positions, velocities = topic.vector("x", "y", "z"), topic.vector("vx", "vy", "vz")
    if positions is None or velocities is None:
        return
    for time_us, place, speed in zip(topic.time_us.tolist(), positions.tolist(), velocities.tolist(), strict=True):
        yield LoggedSample(time_us, position_target(place, speed[2]))


def _landed_states(topics: _Topics) -> Iterator[LoggedSample]:
    """EXTENDED_SYS_STATE by PX4's rule (EXTENDED_SYS_STATE.hpp): one at every change of what it is made of."""
    news: list[tuple[int, str, int]] = []
    for name, field in (
        ("vehicle_land_detected", "landed"),
        ("vehicle_control_mode", "flag_control_auto_enabled"),
        ("position_setpoint_triplet", "current.valid"),
        ("position_setpoint_triplet", "current.type"),
    ):
        topic = topics[name, 0]
        if (values := topic.column(field)) is not None:
            news += [(t, field, int(value)) for t, value in zip(topic.time_us.tolist(), values, strict=True)]
    known: dict[str, int] = {}
    for time_us, field, value in sorted(news, key=lambda item: item[0]):
        known[field] = value
        if "landed" in known:
            yield LoggedSample(time_us, messages.ExtendedState(_landed_state(known)))


def _landed_state(known: Mapping[str, int]) -> messages.LandedState:
    if known["landed"]:
        return messages.LandedState.ON_GROUND
    if known.get("flag_control_auto_enabled") and known.get("current.valid"):
        flown = {_TAKEOFF: messages.LandedState.TAKEOFF, _LAND: messages.LandedState.LANDING}
        return flown.get(known.get("current.type", 0), messages.LandedState.IN_AIR)
    return messages.LandedState.IN_AIR
