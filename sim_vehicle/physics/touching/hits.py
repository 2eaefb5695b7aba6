"""Bookkeeping of hits as they happen: when, how fast, how hard, how deep. Truth, never telemetry."""

from sim_vehicle.physics import layout
from sim_vehicle.physics.inertia import turning_energy
from sim_vehicle.physics.jit import inlined, njit
from sim_vehicle.physics.layout import ContactSprings, PlantState, Scratch
from sim_vehicle.physics.touching.meeting import meet
from sim_vehicle.physics.touching.proximity import NEAR
from sim_vehicle.quantities import Floats, Ints
from sim_vehicle.world import FACE_VELOCITY


@inlined
def note_contact(
    state: PlantState,
    offset_us: float,
    step_s: float,
    near: Ints,
    normal_forces: Floats,
    contact: ContactSprings,
    faces: Floats,
    mass_kg: float,
    scratch: Scratch,
) -> None:
    """Open, extend or leave alone the hit in progress; the ground (face 0) does not count.

    Called at the end of each step; the hit's beginning is the first step with a force in it.
    """
    total_n, hardest, first_point = _hardest(near, normal_forces)
    if total_n <= 0.0:
        return
    now_us = state.time_us + offset_us
    hit = state.hit
    if hit[layout.HIT_ACTIVE] == 1.0 and now_us - hit[layout.HIT_LAST_US] >= layout.SAME_HIT_US:
        _finish(state)
    if hit[layout.HIT_ACTIVE] == 0.0:
        hit[layout.HIT_ACTIVE], hit[layout.HIT_FACE], hit[layout.HIT_START_US] = 1.0, hardest, now_us
        hit[layout.HIT_PEAK_N], hit[layout.HIT_FOLD_M] = 0.0, 0.0
        # A round has a normal only where something meets it.
        meet(first_point, hardest, scratch.turned, state.body, contact, faces, scratch)
        _begin(state, faces[hardest, FACE_VELOCITY : FACE_VELOCITY + 3], scratch)
        hit[layout.HIT_ENERGY_BEFORE_J] = moving_energy(state, mass_kg)
    hit[layout.HIT_LAST_US] = now_us
    hit[layout.HIT_PEAK_N] = max(hit[layout.HIT_PEAK_N], total_n)
    for arm in range(state.fold_m.shape[0]):
        hit[layout.HIT_FOLD_M] = max(hit[layout.HIT_FOLD_M], state.fold_m[arm])
    exit_velocity, impulse = hit[layout.HIT_EXIT_VELOCITY], hit[layout.HIT_IMPULSE]
    for axis in range(3):
        exit_velocity[axis] = state.body[3 + axis]
        impulse[axis] += step_s * scratch.contact_ned[axis]
    hit[layout.HIT_ENERGY_AFTER_J] = moving_energy(state, mass_kg)
    state.peak_force_n = max(state.peak_force_n, total_n)


@njit
def _hardest(near: Ints, normal_forces: Floats) -> tuple[float, int, int]:
    """All that presses, N, the face that presses hardest, and the part that it presses hardest on.

    Of its own: inside its caller the two numbers begin as literals, and for these Numba compiles `meet` once more.
    """
    total_n, most_n, hardest, first_point = 0.0, 0.0, 0, 0
    for face in range(1, near.shape[0]):
        if near[face] < NEAR:
            continue
        on_face, most_on_face, point_on_face = 0.0, 0.0, 0
        for point in range(normal_forces.shape[0]):
            on_face += normal_forces[point, face]
            if normal_forces[point, face] > most_on_face:
                most_on_face, point_on_face = normal_forces[point, face], point
        total_n += on_face
        if on_face > most_n:
            most_n, hardest, first_point = on_face, face, point_on_face
    return total_n, hardest, first_point


@njit
def _begin(state: PlantState, surface_velocity_ned_m_s: Floats, scratch: Scratch) -> None:
    """Where and how fast it began. By axis: to give an array to a slice takes Numba a second to compile."""
    hit = state.hit
    position, velocity, normal = hit[layout.HIT_POSITION], hit[layout.HIT_VELOCITY], hit[layout.HIT_NORMAL]
    point, surface, impulse = hit[layout.HIT_POINT], hit[layout.HIT_SURFACE_VELOCITY], hit[layout.HIT_IMPULSE]
    offset = hit[layout.HIT_FRAME_OFFSET]
    for axis in range(3):
        position[axis], velocity[axis] = state.body[axis], state.body[3 + axis]
        normal[axis], point[axis] = scratch.normal[axis], scratch.where[axis]
        surface[axis], impulse[axis] = surface_velocity_ned_m_s[axis], 0.0
        offset[axis] = state.frame_offset_ned_m[axis]


@njit
def moving_energy(state: PlantState, mass_kg: float) -> float:
    """Kinetic energy of the vehicle relative to the obstacle, J."""
    against = state.hit[layout.HIT_SURFACE_VELOCITY]
    x, y, z = state.body[3] - against[0], state.body[4] - against[1], state.body[5] - against[2]
    turning: float = turning_energy(state.inertia, state.body[10], state.body[11], state.body[12])
    moving: float = 0.5 * mass_kg * (x * x + y * y + z * z)
    return moving + turning


@njit
def close_old_hit(state: PlantState) -> None:
    """End the hit in progress once everything has been clear for long enough."""
    if state.hit[layout.HIT_ACTIVE] == 1.0 and state.time_us - state.hit[layout.HIT_LAST_US] >= layout.SAME_HIT_US:
        _finish(state)


@njit
def _finish(state: PlantState) -> None:
    finished = state.finished_hits[state.finished_count]
    for column in range(state.hit.shape[0]):
        finished[column] = state.hit[column]
    state.finished_count += 1
    state.hit[layout.HIT_ACTIVE] = 0.0
