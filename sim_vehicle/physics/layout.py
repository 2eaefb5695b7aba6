"""The records that the kernels share: what is in them, in which frame and unit."""

import math
from typing import Annotated

import numpy as np

from sim_vehicle.airframe import MOST_ROTORS, Airframe, Bounce
from sim_vehicle.physics.record import Matrix3, Vector3, Vector4, new_record
from sim_vehicle.quantities import Floats

GRAVITY_M_S2 = 9.81

# Size of `PlantState.body`, the rigid body of the paper's eq. 1.
BODY_SIZE = 13

# Points that can touch something: a guard an arm (motor order, the first `ContactSprings.rotors` are there), the hub,
# four feet.
GUARDS = HUB = MOST_ROTORS
FEET, POINTS = HUB + 1, HUB + 5

# Unit vectors in the body frame of a quad-x's arms, in PX4's motor order (front right, rear left, front left, rear
# right), and of any vehicle's feet.
QUAD_X_FRD = np.array([[1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]]) / math.sqrt(2)
# +1 for rotors that turn counter-clockwise seen from above: their reaction yaws the body right (+).
QUAD_X_YAW_SIGNS = np.array([1.0, 1.0, -1.0, -1.0])
PerArm = Annotated[Floats, (MOST_ROTORS,)]
PerPoint = Annotated[Floats, (POINTS,)]


class ContactSprings:
    """Springs and dampers of everything that can touch, in newtons, metres and seconds."""

    rotors: int  # how many, each with an arm and a guard
    arm_direction_frd: Annotated[Floats, (MOST_ROTORS, 3)]  # unit vectors out from the centre
    motor_radius_m: PerArm
    arm_stiffness: PerArm
    arm_damping: PerArm
    fold_max_m: PerArm
    hysteresis_m: PerArm
    least_in_plane: PerArm  # share of a face's normal in the guard's plane that counts at least
    tip_mass_kg: float  # at the end of each arm
    stop_stiffness: float
    stop_damping: float
    hub_stiffness: float
    hub_damping: float
    foot_stiffness: float
    foot_damping: float
    guard_friction: float
    ground_friction: float
    guard_radius_m: float
    guard_half_height_m: float
    hub_radius_m: float
    foot_radius_m: float
    foot_depth_m: float
    reach_m: float


class Disturbance:
    """What acts on the vehicle besides itself and what it runs into; in a calm flight zero, shares one."""

    wind_ned_m_s: Vector3
    motor_share: PerArm  # thrust given of what is commanded
    carried_kg: float  # at the centre of mass, unknown to the control
    pushes: int  # 1 while the push acts
    push_ned_n: Vector3
    push_point_frd_m: Vector3
    shakes: int  # 1 where any of the next is not zero
    shake_m_s2: PerArm  # of each rotor, RMS on each raw axis at hover thrust
    shake_rad_s: PerArm
    shake_hz: float  # turns of a rotor a second at hover thrust
    accelerometer_bias_frd_m_s2: Vector3
    gyroscope_bias_frd_rad_s: Vector3
    stuck: Annotated[Floats, (6,), int]  # 1 for each raw axis that shows ``stuck_at``: accelerometer, gyroscope
    stuck_at: Annotated[Floats, (6,)]
    estimate_jump: Annotated[Floats, (6,)]  # what the estimate of position and velocity is off by, NED


class Gains:
    """Gains and limits of the inner loops (eqs. 4-6)."""

    position_p: Vector3  # along north, east, down
    velocity_p: Vector3
    velocity_i: Vector3
    velocity_d: Vector3
    k_r: Vector3  # N m per unit of e_R
    k_omega: Vector3  # N m per rad/s
    tilt_max_rad: float
    speed_max_m_s: float
    climb_max_m_s: float
    descent_max_m_s: float


class Constants(Gains, ContactSprings):
    """Everything about the vehicle that does not change in a flight."""

    mass_kg: float
    inertia_kg_m2: Vector3  # principal, body frame, arms out
    drag_n_s_m: float
    yaw_sign: PerArm  # of the reaction on the body
    mix: Annotated[Floats, (MOST_ROTORS, 3)]  # of each motor, in the moments about x, y and z: see `_mix`
    roll_lever_m: float  # what divides the first two
    yaw_lever_m: float  # the third
    motor_max_n: float
    all_motors_max_n: float
    motor_idle_n: float
    motor_time_constant_s: float
    moment_per_thrust_m: float
    imu_frd_m: Vector3  # place of the sensor, from the centre of mass
    raw_interval_us: int
    raw_per_interval: int
    accelerometer_range_m_s2: float
    accelerometer_raw_noise_m_s2: float
    accelerometer_bias_frd_m_s2: Vector3
    gyroscope_raw_noise_rad_s: float
    gyroscope_bias_frd_rad_s: Vector3


ASKED_TRAJECTORY, ASKED_ATTITUDE, ASKED_RATES = range(3)


class SetpointRows:
    """A setpoint as the loops read it: rows position, velocity, acceleration, all NED and SI."""

    value: Matrix3
    given: Matrix3  # 1 where the axis is controlled, else 0
    yaw: Vector3  # angle (rad), 1 if it is given else 0, rate (rad/s)
    level: int  # which loop is the first: ASKED_TRAJECTORY, ASKED_ATTITUDE or ASKED_RATES
    attitude: Matrix3  # R_d, body to NED
    rates_frd_rad_s: Vector3
    thrust: float  # of all motors over their greatest


class PlantState:
    """Everything about the vehicle that changes, but for which points are behind which faces."""

    time_us: int  # since boot
    body: Annotated[Floats, (13,)]  # position NED, velocity NED, attitude (w, x, y, z), rates FRD
    motor_thrust_n: PerArm
    motor_command_n: PerArm
    fold_m: PerArm  # of each arm, inward positive
    fold_rate_m_s: PerArm
    pressed: Annotated[Floats, (MOST_ROTORS,), int]  # 1 for the arms that a face presses
    was_near: int  # 1 while the next two may be other than zero
    depth_m: PerPoint  # of each point, in whatever it is deepest in
    share: PerPoint  # of a round's normal in the guard's plane when it touched; 0 where none does
    inertia: Vector4  # J at these folds: xx, yy, zz, xy
    inertia_rate: Vector4
    estimate: Annotated[Floats, (10,)]  # position NED, velocity NED, attitude: what the vehicle itself knows
    frame_offset_ned_m: Vector3  # how far off the vehicle believes itself, its estimate's delay apart
    acceleration_ned_m_s2: Vector3  # low-passed slope of the estimated velocity
    velocity_integral: Vector3  # of eq. 6, m/s2
    yaw_setpoint_rad: float
    attitude_setpoint: Matrix3  # R_d
    collective_n: float  # thrust f of eq. 1
    moment_frd_n_m: Vector3  # moment tau of eq. 5
    position_loops: int  # run so far
    attitude_loops: int
    specific_force_sum: Vector3  # of the clipped raw samples in this interval
    rate_sum: Vector3
    clip_counts: Annotated[Floats, (3,), int]  # since boot
    clipped_off_m_s: Vector3  # velocity that clipping has hidden in this interval, body FRD
    rotor_phase: PerArm  # rad, of the vibration
    peak_force_n: float  # in this interval
    hit: Annotated[Floats, (32,)]  # the hit in progress
    finished_hits: Annotated[Floats, (2, 32)]  # ended in this interval; it is too short for a third
    finished_count: int


class Scratch:
    """Working memory of the kernels."""

    rotation: Matrix3  # body to NED at the last step's start
    turned: Matrix3  # the same at a trial state
    slopes: Annotated[Floats, (4, 13)]  # k1..k4
    trial: Annotated[Floats, (13,)]
    force_ned: Vector3
    moment_frd: Vector3
    thrusts_moment_frd: Vector3  # of the moment, what the motors give over a step
    contact_ned: Vector3  # of the force, what the walls give
    where: Vector3
    normal: Vector3
    on_line: Vector3
    centre: Vector3
    share: PerPoint  # as in the state, at the step's start
    deepest_m: PerPoint  # no point can be deeper at a step's end than this
    lever: Vector3
    speed: Vector3
    rates_ned: Vector3
    velocity_before: Vector3
    rates_before: Vector3
    shaken: Annotated[Floats, (6,)]  # vibration on the raw axes
    fold_before_m: PerArm
    relaxed_m: PerArm  # folds that arms pressed by nothing would have


# Rows of `PlantState.hit`.
HIT_ACTIVE, HIT_FACE, HIT_START_US, HIT_LAST_US, HIT_PEAK_N, HIT_FOLD_M = range(6)
HIT_POSITION, HIT_VELOCITY, HIT_NORMAL, HIT_EXIT_VELOCITY = slice(6, 9), slice(9, 12), slice(12, 15), slice(15, 18)
HIT_IMPULSE, HIT_ENERGY_BEFORE_J, HIT_ENERGY_AFTER_J = slice(18, 21), 21, 22
HIT_POINT, HIT_SURFACE_VELOCITY, HIT_FRAME_OFFSET = slice(23, 26), slice(26, 29), slice(29, 32)

# Contacts closer together than this are one hit: a bounce inside the springs, not a second approach.
SAME_HIT_US = 20_000


def spring_and_damper(bounce: Bounce, mass_kg: float) -> tuple[float, float]:
    """Stiffness (N/m) and damping (N s/m) with which ``mass_kg`` bounces as stated.

    A mass landing on a linear spring and damper pulls itself free when the force is back at zero.
    With damping ratio z that is after t = phi / w_d, phi = atan2(2 z sqrt(1 - z^2), 2 z^2 - 1), at
    exp(-z phi / sqrt(1 - z^2)) of the speed it came with: eq. 2 of the paper (z = 0.671) gives 0.22.
    """
    damping_ratio = _ratio_for(bounce.restitution)
    root = math.sqrt(1 - damping_ratio**2)
    phase = math.atan2(2 * damping_ratio * root, 2 * damping_ratio**2 - 1)
    natural_rad_s = phase / (root * bounce.contact_time_s)
    return mass_kg * natural_rad_s**2, 2 * damping_ratio * natural_rad_s * mass_kg


def _ratio_for(restitution: float) -> float:
    """Damping ratio for a restitution, by bisection: restitution falls as damping grows."""
    low, high = 0.0, 1.0 - 1e-9
    for _ in range(60):
        middle = (low + high) / 2
        root = math.sqrt(1 - middle**2)
        phase = math.atan2(2 * middle * root, 2 * middle**2 - 1)
        if math.exp(-middle * phase / root) > restitution:
            low = middle
        else:
            high = middle
    return (low + high) / 2


# A disc flat against a face (a ceiling) cannot fold its arm towards it. Below this share of the normal in the disc's
# plane the force goes straight through the frame. A frame without arms that fold is as stiff one way as another.
LEAST_IN_PLANE = 0.2


def arms_of(airframe: Airframe) -> tuple[Floats, Floats, Floats]:
    """Of each arm in motor order: the direction from the centre (n, 3), its motor's distance (m) and yaw sign."""
    if not airframe.rotors:
        return QUAD_X_FRD, np.full(len(QUAD_X_FRD), airframe.geometry.motor_radius_m), QUAD_X_YAW_SIGNS
    places_m = np.array([(*rotor.place_frd_m, 0.0) for rotor in airframe.rotors])
    radii_m = np.linalg.norm(places_m, axis=1)
    signs = np.array([1.0 if rotor.direction == "ccw" else -1.0 for rotor in airframe.rotors])
    return places_m / radii_m[:, None], radii_m, signs


def allocation(airframe: Airframe) -> tuple[Floats, float, float]:
    """How moments (FRD, N m) become thrusts: (n, 3) without unit, and the lengths (m) by which the moments about x and
    y, and about z, are divided first.

    It is the pseudo-inverse of what thrusts make, as PX4's. It leaves the sum of thrusts alone, because the rotors lie
    evenly around the centre. A quad-x's are ones, in the sixteenth digit too: hence the rounding.
    """
    directions, radii_m, signs = arms_of(airframe)
    arm_m = airframe.geometry.motor_radius_m / math.sqrt(2)
    places = radii_m[:, None] * directions / arm_m
    made = np.array([-places[:, 1], places[:, 0], signs, np.ones(len(signs))])
    count = len(signs)
    mix = np.round(count * np.linalg.pinv(made)[:, :3], 12)
    lever_m = count * airframe.geometry.motor_radius_m / math.sqrt(2)
    return mix, lever_m, count * airframe.motors.moment_per_thrust_m


def _per_arm(values: Floats) -> Floats:
    """With zeros for the arms that an octorotor would have more."""
    return np.concatenate([values, np.zeros((MOST_ROTORS - len(values), *values.shape[1:]))])


def _contact_values(airframe: Airframe) -> dict[str, float | Floats]:
    """Contact constants. Two guards share a head-on hit, so each arm carries half of eq. 2's mass."""
    mass_kg, arms, geometry = airframe.mass_kg, airframe.arms, airframe.geometry
    directions, radii_m, _ = arms_of(airframe)
    folds = np.array([rotor.spring for rotor in airframe.rotors] or [True] * len(radii_m)) & (arms.fold_max_m > 0.0)
    springy = _per_arm(folds.astype(float))
    stop_stiffness, stop_damping = spring_and_damper(arms.stop, mass_kg / 2)
    hub_stiffness, hub_damping = spring_and_damper(arms.stop, mass_kg)
    foot_stiffness, foot_damping = spring_and_damper(airframe.surface.foot, mass_kg / 4)
    return {
        "rotors": airframe.rotor_count,
        "arm_direction_frd": _per_arm(directions),
        "motor_radius_m": _per_arm(radii_m),
        "arm_stiffness": springy * (arms.stiffness_per_s2 * mass_kg / 2),
        "arm_damping": springy * (arms.damping_per_s * mass_kg / 2),
        "fold_max_m": springy * arms.fold_max_m,
        "hysteresis_m": springy * arms.hysteresis_m,
        "least_in_plane": np.where(springy > 0.0, LEAST_IN_PLANE, 1.0),
        "tip_mass_kg": arms.tip_mass_kg,
        "stop_stiffness": stop_stiffness,
        "stop_damping": stop_damping,
        "hub_stiffness": hub_stiffness,
        "hub_damping": hub_damping,
        "foot_stiffness": foot_stiffness,
        "foot_damping": foot_damping,
        **airframe.surface.model_dump(include={"guard_friction", "ground_friction"}),
        **geometry.model_dump(include={"guard_radius_m", "foot_radius_m", "foot_depth_m"}),
        "guard_half_height_m": geometry.guard_height_m / 2,
        "hub_radius_m": geometry.hub_solid_radius_m,
        "reach_m": geometry.reach_m,
    }


def _gain_values(airframe: Airframe) -> dict[str, float | Floats]:
    """Gains of eqs. 4-6; the attitude's from the closed loop w^2 and 2 z w, scaled by the inertia."""
    control = airframe.control
    climb_p_per_s, climb_i_per_s2 = control.climb_gains
    inertia = np.array(airframe.inertia_kg_m2)
    frequency = np.array([control.attitude_frequency_rad_s] * 2 + [control.yaw_frequency_rad_s])
    return {
        "position_p": control.position_p_per_s,
        "velocity_p": np.array([control.velocity_p_per_s] * 2 + [climb_p_per_s]),
        "velocity_i": np.array([control.velocity_i_per_s2] * 2 + [climb_i_per_s2]),
        "velocity_d": control.velocity_d,
        "k_r": inertia * frequency**2,
        "k_omega": inertia * 2 * control.attitude_damping * frequency,
        **control.model_dump(include={"tilt_max_rad", "speed_max_m_s", "climb_max_m_s", "descent_max_m_s"}),
    }


def constants_from(airframe: Airframe, rng: np.random.Generator) -> Constants:
    """Constants of one flight; the sensor biases are drawn from ``rng``."""
    imu, motors = airframe.imu, airframe.motors
    mix, roll_lever_m, yaw_lever_m = allocation(airframe)
    raw_per_interval = imu.integration_interval_us // imu.raw_interval_us
    return new_record(
        Constants,
        **_contact_values(airframe),
        **_gain_values(airframe),
        mass_kg=airframe.mass_kg,
        inertia_kg_m2=np.array(airframe.inertia_kg_m2),
        drag_n_s_m=airframe.drag_n_s_m,
        yaw_sign=_per_arm(arms_of(airframe)[2]),
        mix=_per_arm(mix),
        roll_lever_m=roll_lever_m,
        yaw_lever_m=yaw_lever_m,
        motor_max_n=motors.max_thrust_n,
        all_motors_max_n=airframe.most_thrust_n,
        motor_idle_n=motors.idle_fraction * motors.max_thrust_n,
        motor_time_constant_s=motors.time_constant_s,
        moment_per_thrust_m=motors.moment_per_thrust_m,
        raw_interval_us=imu.raw_interval_us,
        imu_frd_m=np.array(imu.place_frd_m),
        raw_per_interval=raw_per_interval,
        accelerometer_range_m_s2=imu.accelerometer_range_m_s2,
        accelerometer_raw_noise_m_s2=imu.accelerometer_noise_m_s2 * math.sqrt(raw_per_interval),
        accelerometer_bias_frd_m_s2=imu.accelerometer_bias_m_s2 * rng.standard_normal(3),
        gyroscope_raw_noise_rad_s=imu.gyroscope_noise_rad_s * math.sqrt(raw_per_interval),
        gyroscope_bias_frd_rad_s=imu.gyroscope_bias_rad_s * rng.standard_normal(3),
    )


def calm(wind_ned_m_s: tuple[float, float, float]) -> Disturbance:
    """Nothing but a steady wind."""
    return new_record(Disturbance, wind_ned_m_s=np.array(wind_ned_m_s), motor_share=np.ones(MOST_ROTORS))


def initial_state(position_ned_m: tuple[float, float, float], yaw_rad: float) -> PlantState:
    """A vehicle at rest, level, motors off; ``position_ned_m`` is its centre of mass."""
    attitude = [math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2)]
    return new_record(
        PlantState,
        body=[*position_ned_m, 0.0, 0.0, 0.0, *attitude, 0.0, 0.0, 0.0],
        estimate=[*position_ned_m, 0.0, 0.0, 0.0, *attitude],
        yaw_setpoint_rad=yaw_rad,
        attitude_setpoint=np.eye(3),
    )
