"""Hypotheses about a contact, and their weighted residuals against measurements and prior knowledge.

Hypotheses are flat obstacles with normals around the force's direction, and upright poles at the foremost guards, each
with friction and a time of the first touch. Priors are v_c, the arms' stiffness, the motors and a sample's length.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from companion.estimate import guards as g
from companion.estimate.config import GuardsConfig
from companion.messages import Attitude, ImuSample, Quaternion, Vector3
from companion.motion.rotation import body_to_ned, turned

Floats = npt.NDArray[np.float64]

# Time after the first sample that is fitted. Later an arm meets its stop or the hub the wall: not in the model.
LOOKED_AT_US = 22_000
# Time constant of the weights in the mean force, around which the search begins.
FADING_S = 0.015
# Grid of normals. Friction of 0.3 turns the force by 17 degrees; on a pole the rolling guard turns it by as much again.
SPAN_RAD, STEP_RAD = math.radians(40.0), math.radians(10.0)
FRICTIONS, RADII_M = (0.05, 0.25), (0.04, 0.15)
# Times of the first touch, as shares of the interval between the last free sample and the first of the contact.
MOMENTS = (0.1, 0.3, 0.5, 0.7, 0.9)
# Guards that may touch a pole: the fourth is behind the vehicle.
FOREMOST = 3
# Penalty of a pole: it is as likely as a flat obstacle, and has six hypotheses (guards, radii) for one.
ROUND_CHI_SQUARED = 2.0
# Standard deviations of force, rate and attitude: vibration and bias, and a share of the measured value for the errors
# of the model.
FORCE_M_S2, FORCE_SHARE, RATE_RAD_S, RATE_SHARE, ATTITUDE_RAD = 0.3, 0.06, 0.08, 0.06, 0.01
# Standard deviations of the priors: v_c on an axis, stiffness, the rate controller's gain of 20 /s; poles of 4-20 cm.
VELOCITY_M_S, STIFFER, BRAKING_PER_S, BRAKING_SPREAD = 0.04, 0.1, 20.0, 8.0
RADIUS, RADIUS_SPREAD = math.log(0.1), 0.7
# The sample's length: IMU_INTEG_RATE gives 4 or 5 ms.
AVERAGING_SPREAD_S = 0.0007
# Limits, and the standard deviations beyond them: normals 29 degrees from the force, friction, the lean of poles.
TILT_RAD, TILT_SPREAD, FRICTION_SPREAD, UPRIGHT = 0.5, 0.05, 0.1, 0.05
# Friction of plastic on walls, wood and steel.
EXPECTED_FRICTION, EXPECTED_FRICTION_SPREAD = 0.25, 0.15
# Standard deviation of a clipped force, as a share of it. The rates are not clipped.
CLIPPED_SHARE = 0.3


@dataclass(slots=True)
class Touch:
    """Messages of the first hundredths of a second of a contact."""

    free_frd_m_s2: Vector3
    """The accelerometer's value without the contact."""
    samples: list[ImuSample] = field(default_factory=list)
    """The last free sample, then those of the contact."""
    attitudes: list[Attitude] = field(default_factory=list)
    """From before the contact on, the newest last."""
    is_clipped: bool = False
    """Whether the contact's first sample may be clipped."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """A contact as arrays; times in seconds from its first sample."""

    velocity_ned: Floats
    attitude: Floats
    rates: Floats
    free: Floats
    times: Floats
    is_attitude: npt.NDArray[np.int64]
    measured: Floats
    spread: Floats
    averaging_s: float
    shape: Floats
    force_direction_ned: Floats
    before_s: float


@dataclass(frozen=True, slots=True)
class Hypotheses:
    """Several hypotheses: parameters (n, 11), axes of their normals (n, 3, 3), obstacles (n,)."""

    values: Floats
    axes: Floats
    obstacles: npt.NDArray[np.int64]

    def chosen(self, which: Sequence[int]) -> "Hypotheses":
        return Hypotheses(self.values[which], self.axes[which], self.obstacles[which])

    def normals(self, values: Floats) -> Floats:
        """Unit normals (n, 3), NED, of parameters (n, 11)."""
        tilts = np.tan(values[:, : g.FRICTION])
        vectors = self.axes[:, 0] + tilts[:, :1] * self.axes[:, 1] + tilts[:, 1:] * self.axes[:, 2]
        directions: Floats = vectors / np.linalg.norm(vectors, axis=1)[:, None]
        return directions


def measurement_of(touch: Touch, velocity: Vector3, guards: GuardsConfig, averaging_s: float) -> Measurement | None:
    """None where too few messages have come."""
    if len(touch.samples) < 2:
        return None
    before, first = touch.samples[0], touch.samples[1]
    zero_us, rates = first.time_boot_us, before.angular_velocity_frd_rad_s
    earlier = [told for told in touch.attitudes if told.time_boot_us <= before.time_boot_us]
    if not earlier:
        return None
    attitude = turned(earlier[-1].attitude_wxyz, rates, 1e-6 * (zero_us - earlier[-1].time_boot_us))
    later = [told for told in touch.attitudes if zero_us <= told.time_boot_us <= zero_us + LOOKED_AT_US]
    rows: list[tuple[int, bool, Sequence[float], tuple[float, float]]] = []
    total_force, free = np.zeros(3), touch.free_frd_m_s2
    share = CLIPPED_SHARE if touch.is_clipped else FORCE_SHARE
    for sample in touch.samples:
        f, w = sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s
        force, turn = math.dist(f, free), math.dist(w, rates)
        spread = (math.hypot(FORCE_M_S2, share * force), math.hypot(RATE_RAD_S, RATE_SHARE * turn))
        rows.append((sample.time_boot_us, False, (*f, *w), spread))
        if sample is not before:
            fading = math.exp(-1e-6 * (sample.time_boot_us - zero_us) / FADING_S)
            total_force += fading * np.array(_contact_force_ned(attitude, f, free))
    for told in later:
        rows.append((told.time_boot_us, True, (*told.attitude_wxyz, 0.0, 0.0), (ATTITUDE_RAD, ATTITUDE_RAD)))
    rows.sort(key=lambda row: row[0])
    size = float(np.linalg.norm(total_force))
    if size == 0.0:
        return None
    return Measurement(
        np.array(velocity),
        np.array(attitude),
        np.array(rates),
        np.array(free),
        np.array([1e-6 * (row[0] - zero_us) for row in rows]),
        np.array([row[1] for row in rows], np.int64),
        np.array([row[2] for row in rows], np.float64),
        np.array([row[3] for row in rows]),
        averaging_s,
        _shape(guards),
        total_force / size,
        1e-6 * (before.time_boot_us - zero_us),
    )


def _contact_force_ned(attitude: Quaternion, f: Vector3, free: Vector3) -> Vector3:
    return body_to_ned(attitude, (f[0] - free[0], f[1] - free[1], f[2] - free[2]))


def _shape(guards: GuardsConfig) -> Floats:
    """The vehicle's shape, as `guards.weighted_residuals` takes it."""
    arm = (guards.stiffness_per_s2, guards.damping_per_s, guards.travel_m)
    return np.array([guards.centre_m, guards.radius_m, guards.height_m, *arm, *guards.gyration_frd_m])


def initial_hypotheses(measurement: Measurement) -> Hypotheses:
    """Hypotheses of the coarse search: flat obstacles around the force, upright poles at the foremost guards."""
    angles = np.arange(-SPAN_RAD, SPAN_RAD + 1e-9, STEP_RAD)
    moments = [measurement.before_s * share for share in MOMENTS]
    flat = np.array(np.meshgrid(angles, angles, FRICTIONS, moments)).reshape(4, -1).T
    flat = flat[flat[:, 0] ** 2 + flat[:, 1] ** 2 <= SPAN_RAD**2 + 1e-9]
    groups = [(flat, _axes(measurement.force_direction_ned), g.FLAT, RADIUS)]
    level = measurement.force_direction_ned * (1.0, 1.0, 0.0)
    if np.linalg.norm(level) > 0.5:
        axes = _axes(level / np.linalg.norm(level))
        upright = np.array(np.meshgrid(angles, 0.0, FRICTIONS, moments)).reshape(4, -1).T
        for guard in _foremost(measurement, axes[0]):
            groups += [(upright, axes, guard, math.log(radius_m)) for radius_m in RADII_M]
    values = np.zeros((sum(len(tried) for tried, *_ in groups), g.SIZE))
    values[:, : g.ERROR] = np.concatenate([tried for tried, *_ in groups])
    values[:, g.BRAKING] = BRAKING_PER_S
    values[:, g.AVERAGING] = measurement.averaging_s
    values[:, g.RADIUS] = np.concatenate([np.full(len(tried), radius) for tried, _, _, radius in groups])
    axes_of_all = np.concatenate([np.tile(axes, (len(tried), 1, 1)) for tried, axes, _, _ in groups])
    return Hypotheses(
        values, axes_of_all, np.concatenate([np.full(len(tried), guard) for tried, _, guard, _ in groups])
    )


def _axes(middle: Floats) -> Floats:
    """A unit vector and two at right angles to it, the first of them level where it can be."""
    helper = np.array([0.0, 0.0, 1.0] if abs(middle[2]) < 0.8 else [1.0, 0.0, 0.0])
    one = np.cross(helper, middle)
    one /= np.linalg.norm(one)
    return np.array([middle, one, np.cross(middle, one)])


def _foremost(measurement: Measurement, normal_ned: Floats) -> list[int]:
    """The guards that reach farthest towards an obstacle, the nearest first."""
    w, x, y, z = measurement.attitude.tolist()
    level = body_to_ned((w, -x, -y, -z), (float(normal_ned[0]), float(normal_ned[1]), float(normal_ned[2])))
    return [int(guard) for guard in np.argsort(g.ARMS_FRD @ np.array(level))[:FOREMOST]]


def residuals(measurement: Measurement, hypotheses: Hypotheses, values: Floats, sigma_factor: float) -> Floats:
    """Weighted residuals (n, m) of measurements and priors; `sigma_factor` scales the measurements' deviations."""
    off = g.weighted_residuals(
        values,
        hypotheses.axes,
        hypotheses.obstacles,
        measurement.velocity_ned,
        measurement.attitude,
        measurement.rates,
        measurement.free,
        measurement.times,
        measurement.is_attitude,
        measurement.measured,
        sigma_factor * measurement.spread,
        measurement.shape,
    )
    friction, tilts = values[:, g.FRICTION], np.abs(values[:, : g.FRICTION])
    down = hypotheses.normals(values)[:, 2]
    beforehand = [
        *(values[:, g.ERROR : g.STIFFNESS] / VELOCITY_M_S).T,
        values[:, g.STIFFNESS] / STIFFER,
        (values[:, g.BRAKING] - BRAKING_PER_S) / BRAKING_SPREAD,
        (values[:, g.RADIUS] - RADIUS) / RADIUS_SPREAD,
        (values[:, g.AVERAGING] - measurement.averaging_s) / AVERAGING_SPREAD_S,
        (friction - np.clip(friction, 0.0, g.MOST_FRICTION)) / FRICTION_SPREAD,
        (friction - EXPECTED_FRICTION) / EXPECTED_FRICTION_SPREAD,
        *(np.maximum(tilts - TILT_RAD, 0.0) / TILT_SPREAD).T,
        np.where(hypotheses.obstacles == g.FLAT, 0.0, down / UPRIGHT),
        np.where(hypotheses.obstacles == g.FLAT, 0.0, math.sqrt(ROUND_CHI_SQUARED)),
    ]
    return np.concatenate([off, np.array(beforehand).T], axis=1)
