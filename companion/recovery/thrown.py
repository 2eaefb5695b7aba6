"""How fast a hit throws a vehicle up or down, by how it turned it.

A push j, per unit mass, at r from the middle changes velocity and rates by

    v' = v + j,    w' = w + K^-2 (r x j)

with the radii of gyration K. Gyroscopes do not clip, so of j they show all but what points through the middle; that is
what the rebound takes. Where the guard was touched follows from the obstacle's normal: a flat one meets the foremost
hoop on the edge that leans into it, a round or an edge may meet either of the two that face it. The push is along the
normal and as large as gives back a share e of the speed at which the guard came, and friction ends the sliding or leans
it by its coefficient (Newton's and Coulomb's laws for one touch). As the normal is good to some twenty degrees, many
are tried, each weighed by how well it explains how the vehicle was turned: the throw is their mean, and they say how
far to trust it.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from companion.estimate.rotation import ned_to_body
from companion.messages import Quaternion, Vector3
from companion.mission.config import GuardsConfig

Floats = npt.NDArray[np.float64]

# Frames give back 0.9 within a millisecond in simulation, the stops of arms 0.5 (docs/airframes.md).
STIFF_RESTITUTION, FOLDED_RESTITUTION, FOLDS_US = 0.9, 0.5, 5_000
# PLA on a painted wall, as in estimate.guards.
FRICTION = 0.3
# A normal is as good as this; those further off than 75 degrees are no approach any more.
NORMAL_SPREAD = math.radians(20.0)
TRIED = np.radians(np.arange(-75.0, 76.0, 5.0))
# Attitude loops take 24 rad/s^2 of each rad/s away, and a sample is up to 20 ms late.
RATES_SPREAD_RAD_S = 0.6
# Of the push: restitution, friction and where on the rim are known to so much.
PUSH_SPREAD, LEAST_SPREAD_M_S = 0.15, 0.03
# What is flat comes more often than each of a round's two guards.
ROUND_SHARE = 0.3
# A flat obstacle meets two guards, at once or the second within some milliseconds, where it is as square to both.
SQUARE, BOTH_SHARE = math.cos(math.radians(20.0)), 0.5
# Slower than this a guard was not on its way into an obstacle of that normal.
LEAST_INTO_M_S = 0.02
# A guard that faces the obstacle by less than 73 degrees does not meet it.
LEAST_FACING = 0.3
EDGE_LEAN_RAD = 0.1
ARMS_FRD = np.array([[1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]]) / math.sqrt(2)


@dataclass(frozen=True, slots=True)
class Throw:
    """Of a hit, down positive: the mean, and how far to trust it (a standard deviation)."""

    down_m_s: float
    spread_m_s: float


@dataclass(frozen=True, slots=True)
class Approach:
    """How a vehicle came to what it hit: attitude, body rates and velocity just before."""

    attitude_wxyz: Quaternion
    rates_frd_rad_s: Vector3
    velocity_ned_m_s: Vector3


def thrown(
    approach: Approach, normal_ned: Vector3, turned_frd_rad_s: Vector3, restitution: float, guards: GuardsConfig
) -> Throw | None:
    """The throw of a hit on something upright that changed the body rates by so much.

    None where no guard came near an obstacle of such a normal.
    """
    heading = math.atan2(normal_ned[1], normal_ned[0]) + TRIED
    across = np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=1)
    to_frd = np.array([ned_to_body(approach.attitude_wxyz, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))])
    down_frd = to_frd[2]
    normals, places, misfit = _touches(across @ to_frd, guards)
    velocity = np.array(ned_to_body(approach.attitude_wxyz, approach.velocity_ned_m_s))
    speeds = velocity + np.cross(np.array(approach.rates_frd_rad_s), places)
    into = -_dot(speeds, normals)
    meets = (into > LEAST_INTO_M_S) & np.isfinite(misfit)
    if not meets.any():
        return None
    normals, places, speeds, into, misfit = (each[meets] for each in (normals, places, speeds, into, misfit))
    lever = _crossing(places)
    turning = lever / (np.array(guards.gyration_frd_m) ** 2)[:, None]  # K^-2 [r x]
    push = _push(normals, speeds, into, np.eye(3) - lever @ turning, restitution)
    # The push that was expected, and the turn that was measured (one step of a Kalman filter for each supposition).
    variance = (PUSH_SPREAD * np.linalg.norm(push, axis=1) + LEAST_SPREAD_M_S) ** 2
    covariance = variance[:, None, None] * (turning @ turning.transpose(0, 2, 1)) + RATES_SPREAD_RAD_S**2 * np.eye(3)
    missing = np.array(turned_frd_rad_s) - np.einsum("nij,nj->ni", turning, push)
    explained = _solved(covariance, missing)
    misfit = misfit + _dot(missing, explained) + np.log(np.linalg.det(covariance))
    downwards = turning @ down_frd
    found = push @ down_frd + variance * _dot(downwards, explained)
    left = variance - variance**2 * _dot(downwards, _solved(covariance, downwards))
    weights = np.exp(-0.5 * (misfit - misfit.min()))
    weights /= weights.sum()
    mean = float(weights @ found)
    return Throw(mean, math.sqrt(float(weights @ (left + (found - mean) ** 2))))


def _touches(normals: Floats, guards: GuardsConfig) -> tuple[Floats, Floats, Floats]:
    """Normals, places on a rim (FRD, m) and misfits of what is supposed; infinite where no guard faces it."""
    in_plane: Floats = normals * [1.0, 1.0, 0.0]
    in_plane /= np.linalg.norm(in_plane, axis=1)[:, None]
    nearest = np.argsort(in_plane @ ARMS_FRD.T, axis=1)
    lean = np.clip(normals[:, 2] / EDGE_LEAN_RAD, -1.0, 1.0)
    edge = -0.5 * guards.height_m * lean[:, None] * np.array([0.0, 0.0, 1.0])
    off = np.square(TRIED / NORMAL_SPREAD)
    flat = guards.centre_m * ARMS_FRD[nearest[:, 0]] - guards.radius_m * in_plane + edge
    places, misfits = [flat], [off]
    for which in (0, 1):
        arms = ARMS_FRD[nearest[:, which]]
        faces = _dot(arms, in_plane) <= -LEAST_FACING
        places.append(guards.centre_m * arms - (guards.radius_m + 0.5 * guards.height_m) * in_plane)
        misfits.append(np.where(faces, off - 2.0 * math.log(ROUND_SHARE), np.inf))
    both = 0.5 * (ARMS_FRD[nearest[:, 0]] + ARMS_FRD[nearest[:, 1]])
    square = _dot(both, in_plane) <= -SQUARE * math.sqrt(0.5)
    places.append(guards.centre_m * both - guards.radius_m * in_plane + edge)
    misfits.append(np.where(square, off - 2.0 * math.log(BOTH_SHARE), np.inf))
    return np.tile(normals, (4, 1)), np.concatenate(places), np.concatenate(misfits)


def _push(normals: Floats, speeds: Floats, into: Floats, yields: Floats, restitution: float) -> Floats:
    """The push of each touch, per unit mass; ``yields`` (n, 3, 3) is how it changes the guard's velocity."""
    sticking = _solved(yields, -speeds + restitution * into[:, None] * normals)
    pressing = _dot(sticking, normals)
    aside = np.linalg.norm(sticking - pressing[:, None] * normals, axis=1)
    sliding = speeds + into[:, None] * normals
    leant = normals - FRICTION * sliding / np.maximum(1e-6, np.linalg.norm(sliding, axis=1))[:, None]
    slipping = leant * ((1.0 + restitution) * into / np.einsum("ni,nij,nj->n", normals, yields, leant))[:, None]
    sticks = (pressing > 0.0) & (aside <= FRICTION * pressing)
    return np.where(sticks[:, None], sticking, slipping)


def _solved(matrices: Floats, vectors: Floats) -> Floats:
    return np.asarray(np.linalg.solve(matrices, vectors[:, :, None])[:, :, 0], np.float64)


def _dot(a: Floats, b: Floats) -> Floats:
    products: Floats = np.einsum("ni,ni->n", a, b)
    return products


def _crossing(r: Floats) -> Floats:
    """(n, 3, 3): [r x]."""
    zero = np.zeros(len(r))
    x, y, z = r.T
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
