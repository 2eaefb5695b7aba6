"""What a camera and a beam that look along the body's down axis see of the world (kernels)."""

import math

import numpy as np

from sim_vehicle.physics.jit import njit
from sim_vehicle.physics.rotation import matrix_from_quaternion
from sim_vehicle.physics.touching.meeting import depth_in, within
from sim_vehicle.quantities import Floats
from sim_vehicle.world import FACE_NORMAL

# Rows of what the camera holds: flow and turns integrated since its last sample, then how it moves now.
FLOW_X, FLOW_Y, TURN_X, TURN_Y, TURN_Z, RATE_X, RATE_Y, FASTEST, DISTANCE = range(9)
CAMERA_ROWS = 9


@njit
def distance_below(body: Floats, rotation: Floats, faces: Floats) -> float:
    """Metres from the body's centre along its down axis to the first face seen from its front; inf if none."""
    nearest, seen = math.inf, np.empty(3)
    for face in range(faces.shape[0]):
        towards = 0.0
        for i in range(3):
            towards += rotation[i, 2] * faces[face, FACE_NORMAL + i]
        gap = -depth_in(face, body, faces)
        if towards >= -1e-9 or gap < 0.0:
            continue
        distance = -gap / towards
        for i in range(3):
            seen[i] = body[i] + distance * rotation[i, 2]
        if distance < nearest and within(face, seen, faces, 0.0):
            nearest = distance
    return nearest


@njit
def watch(body: Floats, faces: Floats, step_s: float, camera: Floats) -> None:
    """Let the camera integrate over the interval that has just ended, by the trapezoidal rule.

    ``camera`` (CAMERA_ROWS,) gets the flow that motion over the ground makes (turns come apart from it), the
    turns, and the fastest flow and the distance seen.
    """
    rotation = np.empty((3, 3))
    matrix_from_quaternion(body, rotation)
    distance = distance_below(body, rotation, faces)
    forward = rotation[0, 0] * body[3] + rotation[1, 0] * body[4] + rotation[2, 0] * body[5]
    right = rotation[0, 1] * body[3] + rotation[1, 1] * body[4] + rotation[2, 1] * body[5]
    rate_x, rate_y = -right / distance, forward / distance
    camera[FLOW_X] += 0.5 * step_s * (camera[RATE_X] + rate_x)
    camera[FLOW_Y] += 0.5 * step_s * (camera[RATE_Y] + rate_y)
    for i in range(3):
        camera[TURN_X + i] += step_s * body[10 + i]
    camera[RATE_X], camera[RATE_Y] = rate_x, rate_y
    camera[FASTEST] = max(camera[FASTEST], math.hypot(rate_x + body[10], rate_y + body[11]))
    camera[DISTANCE] = distance
