"""A plate that is swung at the vehicle, touches it at a wanted speed and is taken back."""

import math

import numpy as np

from sim_vehicle.physics.layout import FEET, Constants, PlantState
from sim_vehicle.physics.rotation import matrix_from_quaternion, yaw_of
from sim_vehicle.physics.touching.meeting import deepest_point, is_absent
from sim_vehicle.quantities import Floats, vector
from sim_vehicle.world import Box, Motion, plate

# From appearing to touching: short, so that a vehicle that brakes by 7 m/s2 is met within 0.15 m/s of the speed.
LEAD_S = 0.02
# The longest contact of spring arms is 0.101 s (eq. 2). The plate goes on for that time and is taken back, so that it
# does not strike again when the vehicle brakes.
FOLLOW_S = 0.11
RETREAT_M_S, RETREAT_S = 5.0, 0.3
# Covers the guards of the built-in airframes with room for a miss of 7 cm.
_SIZE_M, THICKNESS_M = 0.6, 0.1

DURATION_S = LEAD_S + FOLLOW_S + RETREAT_S


def strike(
    state: PlantState, constants: Constants, speed_m_s: float, bearing_deg: float, elevation_deg: float, name: str
) -> Box:
    """The plate; its motion begins now and takes DURATION_S.

    ``speed_m_s``: against the vehicle as it moves now. ``bearing_deg``: where it comes from, clockwise from the nose;
    ``elevation_deg``: 90 from above.
    """
    heading, height = yaw_of(state.body) + math.radians(bearing_deg), math.radians(elevation_deg)
    out = np.array(
        [math.cos(height) * math.cos(heading), math.cos(height) * math.sin(heading), -math.sin(height)]
    )  # from the vehicle to where the plate comes from
    centre, velocity = np.array(state.body[0:3]), np.array(state.body[3:6])
    start = centre + (_extent_m(state, constants, out) + speed_m_s * LEAD_S) * out
    swing = (velocity - speed_m_s * out) * (LEAD_S + FOLLOW_S)
    retreat = swing + (velocity + RETREAT_M_S * out) * RETREAT_S
    now_s = state.time_us / 1e6
    motion = Motion(
        (now_s, now_s + LEAD_S + FOLLOW_S, now_s + DURATION_S), ((0.0, 0.0, 0.0), vector(swing), vector(retreat))
    )
    return plate(name, vector(start), vector(-out), (_SIZE_M, _SIZE_M), THICKNESS_M, motion)


def _extent_m(state: PlantState, constants: Constants, direction_ned: Floats) -> float:
    """How far guards and hub reach from the centre of mass in a direction."""
    rotation, where, furthest_m = np.empty((3, 3)), np.empty(3), 0.0
    matrix_from_quaternion(state.body, rotation)
    for point in range(FEET):
        if is_absent(point, constants):
            continue
        _, further_m = deepest_point(point, -direction_ned, rotation, state.body, constants, where)
        furthest_m = max(furthest_m, float((where - state.body[0:3]) @ direction_ned) + further_m)
    return furthest_m
