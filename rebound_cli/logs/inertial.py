"""The inertial samples of a .ulg: which topic to take, and HIGHRES_IMU made of it."""

from collections.abc import Iterable

import numpy as np

from companion.messages import ImuSample
from rebound_cli.logs.log import Heard
from rebound_cli.logs.topics import Floats, Topic, Topics


def inertial_topic(topics: Topics) -> Topic | None:
    """The faster of the two: by default sensor_combined is logged whole and vehicle_imu twice a second."""
    found = [topic for name in ("vehicle_imu", "sensor_combined") if (topic := topics.get(name)) is not None]
    return max(found, key=Topic.rate_hz, default=None)


def imu_samples(topics: Topics, imu: Topic) -> Iterable[Heard]:
    """Mean specific force and angular rate over each integration interval, less the estimator's biases."""
    force, turning, taken_us = _means(imu)
    if force is None or turning is None:
        return
    force = force - _bias(topics, "accel", imu.time_us)
    turning = turning - _bias(topics, "gyro", imu.time_us)
    rows = np.column_stack([force, turning])
    sound = np.isfinite(rows).all(axis=1)
    times = zip(imu.time_us[sound].tolist(), taken_us[sound].tolist(), strict=True)
    for (heard_us, sample_us), (a_x, a_y, a_z, w_x, w_y, w_z) in zip(times, rows[sound].tolist(), strict=True):
        yield Heard(heard_us, ImuSample(sample_us, (a_x, a_y, a_z), (w_x, w_y, w_z)))


def _means(imu: Topic) -> tuple[Floats | None, Floats | None, np.ndarray]:
    """sensor_combined holds means; vehicle_imu holds increments and how long they took, in microseconds."""
    force = imu.array("accelerometer_m_s2")
    if force is not None:
        return force, imu.array("gyro_rad"), imu.time_us
    velocity, velocity_us = imu.array("delta_velocity"), imu.column("delta_velocity_dt")
    angle, angle_us = imu.array("delta_angle"), imu.column("delta_angle_dt")
    if velocity is None or velocity_us is None or angle is None or angle_us is None:
        return None, None, imu.time_us
    with np.errstate(divide="ignore", invalid="ignore"):
        force, turning = velocity / (velocity_us[:, None] * 1e-6), angle / (angle_us[:, None] * 1e-6)
    taken = imu.fields.get("timestamp_sample")
    return force, turning, imu.time_us if taken is None else taken.astype(np.int64)


def _bias(topics: Topics, sensor: str, at_us: np.ndarray) -> Floats:
    """What the primary estimator held the bias for at each time; zero where it is not logged."""
    biases = np.zeros((len(at_us), 3))
    primary = _held(topics.get("estimator_selector_status"), "primary_instance", at_us)
    for instance, topic in enumerate(topics.instances("estimator_sensor_bias")):
        values = topic.array(f"{sensor}_bias")
        device = topic.column(f"{sensor}_device_id")
        if values is None:
            continue
        known = values if device is None else np.where((device > 0)[:, None], values, 0.0)
        index = np.searchsorted(topic.time_us, at_us, side="right") - 1
        held = np.where((index >= 0)[:, None], known[np.maximum(index, 0)], 0.0)
        biases = np.where((primary == instance)[:, None], held, biases)
    return biases


def _held(topic: Topic | None, field: str, at_us: np.ndarray) -> Floats:
    """The field's last value at each time, its first before that; zero without the topic."""
    values = None if topic is None else topic.column(field)
    if topic is None or values is None:
        return np.zeros(len(at_us))
    return values[np.maximum(np.searchsorted(topic.time_us, at_us, side="right") - 1, 0)]


def clipped_at_us(imu: Topic) -> tuple[int, ...] | None:
    """When a raw reading inside a sample was at the end of the sensor's range; None if the version does not say."""
    flags = imu.column("accelerometer_clipping")
    if flags is None:
        flags = imu.column("delta_velocity_clipping")
    return None if flags is None else tuple(imu.time_us[flags > 0].tolist())


def averaging_us(imu: Topic) -> float | None:
    """The interval of one mean; a driver that reads its sensor in blocks makes some of them longer."""
    intervals = imu.column("accelerometer_integral_dt")
    if intervals is None:
        intervals = imu.column("delta_velocity_dt")
    return None if intervals is None else float(np.percentile(intervals, 99))
