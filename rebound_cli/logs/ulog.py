"""PX4's own logs (.ulg) as the samples that its MAVLink link would have carried.

The conversions are those of PX4's mavlink/streams (HIGHRES_IMU, LOCAL_POSITION_NED, ODOMETRY, ATTITUDE_QUATERNION,
ATTITUDE_TARGET, VIBRATION, EXTENDED_SYS_STATE, HEARTBEAT). A log holds most topics at lower rates than the wire
would, and which it holds differs from version to version (v1.11 to v1.16 and later): what is not there is said.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from companion.link.vehicle import AUTOPILOT_COMPONENT_ID, MAV_AUTOPILOT_PX4, MULTICOPTERS
from companion.messages import Attitude, AttitudeTarget, Heartbeat, LocalPosition, Odometry, Vector3, Vibration
from rebound_cli.logs.inertial import averaging_us, clipped_at_us, imu_samples, inertial_topic
from rebound_cli.logs.kind import QUADROTOR, other_arms, rotors, vehicle_type
from rebound_cli.logs.landed import landed_states
from rebound_cli.logs.log import Demand, Heard, Log, LogError, checked
from rebound_cli.logs.modes import custom_mode
from rebound_cli.logs.topics import ARMED, Topic, Topics

_NAMES = (
    *("sensor_combined", "vehicle_imu", "vehicle_imu_status", "estimator_sensor_bias", "estimator_selector_status"),
    *("vehicle_local_position", "vehicle_attitude", "vehicle_attitude_setpoint", "vehicle_status"),
    *("vehicle_land_detected", "vehicle_control_mode", "position_setpoint_triplet", "trajectory_setpoint"),
    *("vehicle_local_position_setpoint", "hover_thrust_estimate"),
)

# MAV_STATE, as PX4 fills HEARTBEAT.system_status.
_STANDBY, _ACTIVE, _CRITICAL = 3, 4, 5

# What a missing topic costs, in the words of docs/replay.md.
_COSTS = {
    "vehicle_local_position": "height and velocity are not known: no v_c, and landings are told by the land detector",
    "vehicle_attitude": "the direction of a hit in the world is not known",
    "vehicle_attitude_setpoint": "thrust is not known: hits along body z are judged by the force's own change alone",
    "vehicle_land_detected": "landed or not is not known: a touchdown can look like a hit",
    "vehicle_status": "armed or not is not known: the whole log is taken for a flight",
    "vehicle_imu_status": "clipping and vibration are not known beyond the samples themselves",
}
# A topic that begins this much later than the IMU samples was not there when something may have happened.
_LATE_US = 1_000_000
# No battery lasts so long: a time stamp further from the middle of the log is damage.
_LONGEST_US = 24 * 3600 * 1_000_000
# Slower than a third of the wire's 30 Hz, a velocity is old by the time of a hit.
_SLOW_HZ = 15.0


def read_ulog(path: Path) -> Log:
    """Raises LogError."""
    topics = Topics(path, _NAMES)
    imu = inertial_topic(topics)
    if imu is None:
        raise LogError(
            f"{path}: neither sensor_combined nor vehicle_imu in it; PX4 logs them by default (SDLOG_PROFILE)."
        )
    kind = vehicle_type(path, topics)
    heard: list[Heard] = list(imu_samples(topics, imu))
    for names, convert in _CONVERSIONS.items():
        topic = topics.first(*names)
        if topic is not None:
            heard.extend(convert(topic))
    heard.extend(landed_states(topics))
    middle_us = int(np.median(imu.time_us))
    heard = sorted((item for item in heard if abs(item.at_us - middle_us) < _LONGEST_US), key=lambda item: item.at_us)
    version = "" if topics.version is None else " " + ".".join(map(str, topics.version))
    hardware = f" on {topics.hardware}" if topics.hardware else ""
    return checked(
        Log(
            path=path,
            vehicle=f"PX4{version}{hardware}",
            started_at_us=topics.started_us,
            heard=tuple(heard),
            losses=tuple(_losses(topics, imu)),
            hover_thrust_fraction=_hover_thrust(topics),
            clipped_at_us=clipped_at_us(imu),
            averaging_us=averaging_us(imu),
            other_arms=other_arms(MULTICOPTERS[kind], rotors(topics)),
        )
    )


def _losses(topics: Topics, imu: Topic) -> Iterable[str]:
    if topics.is_damaged:
        yield "the file is damaged in places: samples are missing there"
    if topics.lost_s > 0:
        yield f"the logger dropped {topics.lost_s:.2f} s of data: nothing is seen there"
    for name, cost in _COSTS.items():
        topic = topics.get(name)
        if topic is None:
            yield f"no {name}: {cost}"
        elif topic.time_us[0] - imu.time_us[0] > _LATE_US:
            yield f"no {name} before {(topic.time_us[0] - topics.started_us) * 1e-6:.1f} s: until then {cost}"
    position = topics.get("vehicle_local_position")
    if position is not None:
        if position.rate_hz() < _SLOW_HZ:
            yield (
                f"vehicle_local_position is logged at {position.rate_hz():.0f} Hz where the wire carries 30 or more: "
                "v_c is coarser than in flight"
            )
        for flag, what in (("v_xy_valid", "horizontal velocity"), ("v_z_valid", "vertical velocity")):
            valid = position.column(flag)
            if valid is not None and not valid.all():
                share = 100 * (1 - float(valid.mean()))
                yield f"the {what} is invalid by the estimator's own word for {share:.0f} % of the log: so is v_c"
    if imu.column("accelerometer_clipping") is None and imu.column("delta_velocity_clipping") is None:
        yield "no clipping flags in this version: clipped peaks are told by their size alone"


def _local_position(topic: Topic) -> Iterable[Heard]:
    """LOCAL_POSITION_NED and, where the version counts its jumps, ODOMETRY: the wire sends both, valid or not."""
    rows = topic.vector("x", "y", "z", "vx", "vy", "vz")
    if rows is None:
        return
    counters = [topic.fields.get(f"{name}_reset_counter") for name in ("xy", "z", "vxy", "vz")]
    counts = sum(c.astype(np.int64) for c in counters if c is not None)
    resets = np.broadcast_to(counts, len(rows)).tolist() if any(c is not None for c in counters) else None
    for index, (time_us, row) in enumerate(zip(topic.time_us.tolist(), rows.tolist(), strict=True)):
        if not np.isfinite(row).all():
            continue
        position, velocity = _vector(row[:3]), _vector(row[3:])
        # The message's stamp is cut to milliseconds.
        yield Heard(time_us, LocalPosition(time_us // 1000 * 1000, position, velocity))
        if resets is not None:
            yield Heard(time_us, Odometry(time_us, position, velocity, resets[index] % 256))


def _attitude(topic: Topic) -> Iterable[Heard]:
    quaternions = topic.array("q", 4)
    if quaternions is None:
        return
    rates = topic.vector("rollspeed", "pitchspeed", "yawspeed")  # until v1.11
    for index, (time_us, row) in enumerate(zip(topic.time_us.tolist(), quaternions.tolist(), strict=True)):
        if np.isfinite(row).all():
            turning = None if rates is None else _vector(rates[index].tolist())
            yield Heard(time_us, Attitude(time_us // 1000 * 1000, (row[0], row[1], row[2], row[3]), turning))


def _attitude_target(topic: Topic) -> Iterable[Heard]:
    thrust = topic.array("thrust_body")
    if thrust is None:
        return
    attitudes = topic.array("q_d", 4)
    fractions = np.linalg.norm(thrust, axis=1).tolist()
    for index, (time_us, fraction) in enumerate(zip(topic.time_us.tolist(), fractions, strict=True)):
        if not np.isfinite(fraction):
            continue
        attitude = None
        if attitudes is not None and np.isfinite(attitudes[index]).all():
            w, x, y, z = attitudes[index].tolist()
            attitude = (w, x, y, z)
        yield Heard(time_us, AttitudeTarget(time_us // 1000 * 1000, fraction, attitude))


def _vibration(topic: Topic) -> Iterable[Heard]:
    clipping = topic.array("accel_clipping")
    levels = topic.vector("gyro_vibration_metric", "accel_vibration_metric")
    if clipping is None or levels is None:
        return
    counts = clipping.sum(axis=1).astype(np.int64).tolist()
    for time_us, count, (gyroscope, accelerometer) in zip(topic.time_us.tolist(), counts, levels.tolist(), strict=True):
        yield Heard(time_us, Vibration(time_us, gyroscope, accelerometer, (count, 0, 0)))


def _heartbeat(topic: Topic) -> Iterable[Heard]:
    arming, navigation = topic.column("arming_state"), topic.column("nav_state")
    if arming is None:
        return
    count = len(arming)
    failsafe, kinds = topic.column("failsafe"), topic.column("system_type")
    modes = [0] * count if navigation is None else [custom_mode(int(state)) for state in navigation]
    for index, time_us in enumerate(topic.time_us.tolist()):
        armed = arming[index] == ARMED
        acting = failsafe is not None and bool(failsafe[index])
        kind = int(kinds[index]) if kinds is not None and int(kinds[index]) in MULTICOPTERS else QUADROTOR
        status = _CRITICAL if acting else _ACTIVE if armed else _STANDBY
        beat = Heartbeat(1, AUTOPILOT_COMPONENT_ID, kind, MAV_AUTOPILOT_PX4, bool(armed), modes[index], status)
        yield Heard(time_us, beat)


def _demand(topic: Topic) -> Iterable[Heard]:
    """Fields are x, y, z, vx, ... until v1.13 and position[], velocity[] since; NaN where nothing is asked."""
    positions = topic.array("position")
    velocities = topic.array("velocity")
    if positions is None or velocities is None:
        positions, velocities = topic.vector("x", "y", "z"), topic.vector("vx", "vy", "vz")
    if positions is None or velocities is None:
        return
    for time_us, place, speed in zip(topic.time_us.tolist(), positions.tolist(), velocities.tolist(), strict=True):
        position = _vector(place) if np.isfinite(place).all() else None
        velocity = _vector(speed) if np.isfinite(speed).all() else None
        down = speed[2] if np.isfinite(speed[2]) else None
        yield Heard(time_us, Demand(time_us, position, velocity, down))


def _hover_thrust(topics: Topics) -> float | None:
    estimate = topics.get("hover_thrust_estimate")
    if estimate is not None:
        values, valid = estimate.column("hover_thrust"), estimate.column("valid")
        if values is not None:
            chosen = values if valid is None else values[valid > 0]
            if len(chosen):
                return float(np.median(chosen))
    parameter = topics.parameters.get("MPC_THR_HOVER")
    return None if parameter is None else float(parameter)


def _vector(row: list[float]) -> Vector3:
    return (row[0], row[1], row[2])


_CONVERSIONS = {
    ("vehicle_local_position",): _local_position,
    ("vehicle_attitude",): _attitude,
    ("vehicle_attitude_setpoint",): _attitude_target,
    ("vehicle_imu_status",): _vibration,
    ("vehicle_status",): _heartbeat,
    ("trajectory_setpoint", "vehicle_local_position_setpoint"): _demand,
}
