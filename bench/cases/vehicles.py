"""Vehicles nobody tuned for: everything that makes a quadrotor drawn from a seed, within stated ranges.

The two built-in airframes are named points of these ranges. Ranges are those of multicopters that carry a Pixhawk, from
a 5-inch to a 10-inch propeller; where a figure has a source of its own, it is named.
"""

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from bench.cases.draw import Draw
from rebound_cli.inputs import guards_of
from sim_vehicle.airframe import Airframe, load_built_in, with_base

Part = dict[str, Any]
# What a vehicle's seed is joined with, so that its room is drawn from other numbers.
_OF_VEHICLES = 1_000_003
# From the paper's two: arms that fold, and a frame that does not.
AIRFRAMES = ("foldable", "rigid")
MASS_KG = (0.7, 2.2)
# Centre to motor for one kilogram; a vehicle's size grows with the cube root of its mass.
ARM_M_PER_KG3 = (0.12, 0.18)
# Radius of gyration about roll or pitch over the arm: battery and computer in the middle, motors outside.
GYRATION_SHARE = (0.30, 0.45)
# About yaw: that of a flat body would be the root of the sum of squares; a body with height has less.
YAW_SHARE = (0.85, 0.98)
# Guards, as a share of the arm; at 0.707 neighbours would touch.
GUARD_SHARE = (0.45, 0.62)
GUARD_HEIGHT_M = (0.01, 0.04)
FOOT_DEPTH_M = (0.05, 0.09)
# Of thrust to weight: from a loaded platform, 70 % at hover, to a light one.
HOVER_SHARE = (0.33, 0.72)
# Linear drag over mass: 0.25 N s/m at 1.1 kg is 2.6 degrees of lean at 2 m/s.
DRAG_PER_S = (0.1, 0.3)
MOTOR_LAG_S = (0.015, 0.03)
# Of eq. 2: natural frequency and damping ratio; the paper's springs are 22 rad/s and 0.67.
SPRING_RAD_S = (14.0, 32.0)
SPRING_DAMPING = (0.3, 1.0)
FOLD_M = (0.02, 0.045)
# The stop of a folding arm, and a frame: pulses of 3 to 7 ms on concrete (thecognifly/CrashLandingExperiments), about
# 1 ms for a stiff frame (the paper, section V); rebounds of 0.40 to 0.66 (mrl-abazari/mav_contact_lcs), 0.9 at most.
STOP_TIME_S = {"foldable": (0.003, 0.007), "rigid": (0.001, 0.005)}
RESTITUTION = {"foldable": (0.3, 0.7), "rigid": (0.3, 0.9)}
# Plastics and carbon fibre on plaster, wood or concrete.
FRICTION = (0.1, 0.6)
# PX4's IMU_INTEG_RATE 200 (default) and 250; and the ranges of a 16 g, 24 g (BMI088) and 32 g (ICM-45686) sensor.
INTEGRATION_US = (5_000, 4_000)
ACCELEROMETER_RANGE_M_S2 = (156.9, 235.4, 313.8)
# Vibration in the mean of one sample, by a well-balanced and by a neglected vehicle; drawn by its logarithm.
VIBRATION_M_S2 = (0.1, 1.5)
GYROSCOPE_NOISE_RAD_S = (0.003, 0.03)
# An estimate by motion capture, optical flow or a good GPS.
DELAY_S = (0.0, 0.05)
VELOCITY_NOISE_M_S = (0.01, 0.08)
VELOCITY_CORRELATION_S = (0.1, 1.0)
POSITION_NOISE_M = (0.003, 0.03)
# How an estimate comes right after a hit beyond the accelerometer's range, PX4's measured 0.16 s, 4.7 rad/s and 0.67
# inside, and 0.13 s, 2.4 rad/s and 0.69 by GPS; what is taken for a tilt goes as slowly by either (bench/notes/px4.md).
# A quarter of vehicles has one that knows all of a hit.
CLIPPING_KNOWN_SHARE = 0.25
CLIPPING_LATE_S = (0.05, 0.25)
CLIPPING_RAD_S = (2.5, 8.0)
CLIPPING_DAMPING = (0.4, 1.0)
CLIPPING_TILT_PER_S = 0.5
# Attitude loop over the motors' own bandwidth: the paper's airframe has 0.24.
ATTITUDE_SHARE = (0.20, 0.26)
# Each loop over the one inside it: the paper's airframe has 1/3, and 0.95 / 4, for velocity over attitude and position
# over velocity. A vehicle that turns slowly is given slower gains, as by anybody who tunes it.
VELOCITY_SHARE = (0.28, 0.34)
POSITION_SHARE = (0.20, 0.26)
# A climb needs no turn: PX4's MPC_Z_VEL_P_ACC and MPC_Z_VEL_I_ACC are 4 and 2.
CLIMB_P_PER_S = (3.0, 5.0)
CLIMB_I_PER_S2 = (1.5, 3.0)


def drawn_vehicle(seed: int, kind: str) -> Part:
    """An airframe file. `kind`: "foldable" for spring arms, "rigid" for a frame without. The same vehicle but for the
    arms for both."""
    draw = Draw(seed, _OF_VEHICLES)
    mass_kg = draw.number(*MASS_KG)
    arm_m = round(draw.number(*ARM_M_PER_KG3) * mass_kg ** (1 / 3), 3)
    roll_m, pitch_m = (draw.number(*GYRATION_SHARE) * arm_m for _ in "xy")
    yaw_m = draw.number(*YAW_SHARE) * math.hypot(roll_m, pitch_m)
    guard_m = round(draw.number(*GUARD_SHARE) * arm_m, 3)
    lag_s = draw.number(*MOTOR_LAG_S)
    foot_m = draw.number(*FOOT_DEPTH_M)
    hover_share = draw.number(*HOVER_SHARE)
    return {
        "based_on": kind,
        "name": f"{kind}-{seed}",
        "description": f"a {kind} vehicle drawn from seed {seed}",
        "mass_kg": mass_kg,
        "inertia_kg_m2": [round(mass_kg * length_m**2, 6) for length_m in (roll_m, pitch_m, yaw_m)],
        "drag_n_s_m": round(draw.number(*DRAG_PER_S) * mass_kg, 3),
        "geometry": {
            # A quarter of the way to the motor is the body's.
            "hub_radius_m": round(0.25 * arm_m, 3),
            "hub_solid_radius_m": round(min(0.35 * arm_m, foot_m - 0.02), 3),
            "arm_length_m": round(arm_m - round(0.25 * arm_m, 3), 3),
            "guard_radius_m": guard_m,
            "guard_height_m": draw.number(*GUARD_HEIGHT_M),
            "foot_radius_m": round(0.75 * arm_m, 3),
            "foot_depth_m": foot_m,
        },
        "motors": {"max_thrust_n": round(mass_kg * 9.81 / 4 / hover_share, 3), "time_constant_s": lag_s},
        "surface": {"guard_friction": draw.number(*FRICTION)},
        "imu": _imu(draw),
        "estimate": _estimate(draw),
        "control": _control(draw, lag_s),
        # Last: all else is the same for both kinds.
        "arms": _arms(draw, kind, arm_m, guard_m, mass_kg * yaw_m**2),
    }


def _imu(draw: Draw) -> Part:
    low, high = (math.log(value) for value in VIBRATION_M_S2)
    return {
        "integration_interval_us": draw.one_of(INTEGRATION_US),
        "accelerometer_range_m_s2": draw.one_of(ACCELEROMETER_RANGE_M_S2),
        "accelerometer_noise_m_s2": round(math.exp(draw.number(low, high)), 3),
        "gyroscope_noise_rad_s": draw.number(*GYROSCOPE_NOISE_RAD_S),
    }


def _estimate(draw: Draw) -> Part:
    clipping = {
        "late_s": draw.number(*CLIPPING_LATE_S),
        "frequency_rad_s": draw.number(*CLIPPING_RAD_S),
        "damping": draw.number(*CLIPPING_DAMPING),
        "tilt_per_s": CLIPPING_TILT_PER_S,
    }
    return {
        "delay_s": draw.number(*DELAY_S),
        "velocity_noise_m_s": draw.number(*VELOCITY_NOISE_M_S),
        "velocity_correlation_s": draw.number(*VELOCITY_CORRELATION_S),
        "position_noise_m": draw.number(*POSITION_NOISE_M),
        "clipping": None if draw.happens(CLIPPING_KNOWN_SHARE) else clipping,
    }


def _control(draw: Draw, lag_s: float) -> Part:
    attitude_rad_s = draw.number(*ATTITUDE_SHARE) / lag_s
    velocity_per_s = draw.number(*VELOCITY_SHARE) * attitude_rad_s
    return {
        "attitude_frequency_rad_s": round(attitude_rad_s, 2),
        "velocity_p_per_s": round(velocity_per_s, 2),
        # P over I takes 1.3 s with 4/s.
        "velocity_i_per_s2": round(3.0 / 16.0 * velocity_per_s**2, 2),
        "position_p_per_s": round(draw.number(*POSITION_SHARE) * velocity_per_s, 2),
        "climb_p_per_s": draw.number(*CLIMB_P_PER_S),
        "climb_i_per_s2": draw.number(*CLIMB_I_PER_S2),
    }


def _arms(draw: Draw, kind: str, arm_m: float, guard_m: float, yaw_kg_m2: float) -> Part:
    fold_m, rad_s = draw.number(*FOLD_M), draw.number(*SPRING_RAD_S)
    # Folded guards must not meet; four tips on their arms have less inertia than the whole vehicle.
    fold_m = round(min(fold_m, arm_m - (guard_m + 0.002) * math.sqrt(2.0)), 3)
    springs: Part = {
        "stiffness_per_s2": round(rad_s**2, 1),
        "damping_per_s": round(2.0 * draw.number(*SPRING_DAMPING) * rad_s, 1),
        "fold_max_m": fold_m,
        "hysteresis_m": round(fold_m / 15.0, 4),
    }
    return {
        **(springs if kind == "foldable" else {}),
        "tip_mass_kg": round(0.6 * yaw_kg_m2 / (4.0 * arm_m**2), 4),
        "stop": {
            "contact_time_s": draw.number(*STOP_TIME_S[kind]),
            "restitution": draw.number(*RESTITUTION[kind]),
        },
    }


def companion_settings(data: Part) -> Part:
    """What its owner writes into `companion:`, from a ruler, a scale and the IMU's data sheet."""
    airframe = Airframe.model_validate(with_base(data))
    return {
        "estimate": {
            "imu_averaging_interval_s": airframe.imu.integration_interval_us * 1e-6,
            "accelerometer_range_m_s2": airframe.imu.accelerometer_range_m_s2,
            "guards": guards_of(airframe),
        }
    }


@dataclass(frozen=True, slots=True)
class BenchVehicle:
    """An airframe, and what its owner writes into `companion:` of a mission with it."""

    airframe: Airframe
    settings: dict[str, Any] = field(default_factory=dict)


@lru_cache(maxsize=16)
def vehicle_of(kind: str, seed: int | None = None) -> BenchVehicle:
    """The named airframe, or of a seed the vehicle of its kind that is drawn from it.

    Reading an airframe's file takes longer than flying a hit with it.
    """
    if seed is None:
        airframe = load_built_in(kind)
        return BenchVehicle(airframe, {"estimate": {"guards": guards_of(airframe)}})
    data = drawn_vehicle(seed, kind)
    return BenchVehicle(Airframe.model_validate(with_base(data)), companion_settings(data))
