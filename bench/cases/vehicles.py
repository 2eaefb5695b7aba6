"""Vehicles nobody tuned for: everything that makes a quadrotor drawn from a seed, within `vehicles.yaml`'s ranges."""

import math
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from bench.cases.draw import Draw
from rebound_cli.inputs.inputs import guards_of, load_world
from sim_vehicle.airframe import Airframe, with_base

Part = dict[str, Any]
# What a vehicle's seed is joined with, so that its room is drawn from other numbers.
_OF_VEHICLES = 1_000_003
# The same of where its inertial sensor is: drawn apart, so that all else stays as it was.
_OF_SENSORS = 1_000_033
# From the paper's two: arms that fold, and a frame that does not.
AIRFRAMES = ("foldable", "rigid")
RANGES = yaml.safe_load(Path(__file__).with_name("vehicles.yaml").read_text("utf-8"))


def drawn_vehicle(seed: int, kind: str) -> Part:
    """An airframe file. `kind`: "foldable" for spring arms, "rigid" for a frame without. The same vehicle but for the
    arms for both."""
    draw = Draw(seed, _OF_VEHICLES)
    mass_kg = draw.number(*RANGES["mass_kg"])
    arm_m = round(draw.number(*RANGES["arm_m_per_kg3"]) * mass_kg ** (1 / 3), 3)
    roll_m, pitch_m = (draw.number(*RANGES["gyration_share"]) * arm_m for _ in "xy")
    yaw_m = draw.number(*RANGES["yaw_share"]) * math.hypot(roll_m, pitch_m)
    guard_m = round(draw.number(*RANGES["guard_share"]) * arm_m, 3)
    lag_s = draw.number(*RANGES["motor_lag_s"])
    foot_m = draw.number(*RANGES["foot_depth_m"])
    hover_share = draw.number(*RANGES["hover_share"])
    return {
        "based_on": kind,
        "name": f"{kind}-{seed}",
        "description": f"a {kind} vehicle drawn from seed {seed}",
        "mass_kg": mass_kg,
        "inertia_kg_m2": [round(mass_kg * length_m**2, 6) for length_m in (roll_m, pitch_m, yaw_m)],
        "drag_n_s_m": round(draw.number(*RANGES["drag_per_s"]) * mass_kg, 3),
        "geometry": {
            # A quarter of the way to the motor is the body's.
            "hub_radius_m": round(0.25 * arm_m, 3),
            "hub_solid_radius_m": round(min(0.35 * arm_m, foot_m - 0.02), 3),
            "arm_length_m": round(arm_m - round(0.25 * arm_m, 3), 3),
            "guard_radius_m": guard_m,
            "guard_height_m": draw.number(*RANGES["guard_height_m"]),
            "foot_radius_m": round(0.75 * arm_m, 3),
            "foot_depth_m": foot_m,
        },
        "motors": {"max_thrust_n": round(mass_kg * 9.81 / 4 / hover_share, 3), "time_constant_s": lag_s},
        "surface": {"guard_friction": draw.number(*RANGES["friction"])},
        "imu": _imu(draw) | _place(Draw(seed, _OF_SENSORS)),
        "estimate": _estimate(draw),
        "control": _control(draw, lag_s),
        # Last: all else is the same for both kinds.
        "arms": _arms(draw, kind, arm_m, guard_m, mass_kg * yaw_m**2),
    }


def _place(draw: Draw) -> Part:
    return {
        key: draw.number(*RANGES[f"imu_{key}"]) for key in ("above_centre_m", "ahead_of_centre_m", "right_of_centre_m")
    }


def _imu(draw: Draw) -> Part:
    low, high = (math.log(value) for value in RANGES["vibration_m_s2"])
    return {
        "integration_interval_us": draw.one_of(RANGES["integration_us"]),
        "accelerometer_range_m_s2": draw.one_of(RANGES["accelerometer_range_m_s2"]),
        "accelerometer_noise_m_s2": round(math.exp(draw.number(low, high)), 3),
        "gyroscope_noise_rad_s": draw.number(*RANGES["gyroscope_noise_rad_s"]),
    }


def _estimate(draw: Draw) -> Part:
    clipping = {
        "late_s": draw.number(*RANGES["clipping_late_s"]),
        "frequency_rad_s": draw.number(*RANGES["clipping_rad_s"]),
        "damping": draw.number(*RANGES["clipping_damping"]),
        "tilt_per_s": RANGES["clipping_tilt_per_s"],
    }
    return {
        "delay_s": draw.number(*RANGES["delay_s"]),
        "velocity_noise_m_s": draw.number(*RANGES["velocity_noise_m_s"]),
        "velocity_correlation_s": draw.number(*RANGES["velocity_correlation_s"]),
        "position_noise_m": draw.number(*RANGES["position_noise_m"]),
        "clipping": None if draw.happens(RANGES["clipping_known_share"]) else clipping,
    }


def _control(draw: Draw, lag_s: float) -> Part:
    attitude_rad_s = draw.number(*RANGES["attitude_share"]) / lag_s
    velocity_per_s = draw.number(*RANGES["velocity_share"]) * attitude_rad_s
    return {
        "attitude_frequency_rad_s": round(attitude_rad_s, 2),
        "velocity_p_per_s": round(velocity_per_s, 2),
        # P over I takes 1.3 s with 4/s.
        "velocity_i_per_s2": round(3.0 / 16.0 * velocity_per_s**2, 2),
        "position_p_per_s": round(draw.number(*RANGES["position_share"]) * velocity_per_s, 2),
        "climb_p_per_s": draw.number(*RANGES["climb_p_per_s"]),
        "climb_i_per_s2": draw.number(*RANGES["climb_i_per_s2"]),
    }


def _arms(draw: Draw, kind: str, arm_m: float, guard_m: float, yaw_kg_m2: float) -> Part:
    fold_m, rad_s = draw.number(*RANGES["fold_m"]), draw.number(*RANGES["spring_rad_s"])
    # Folded guards must not meet; four tips on their arms have less inertia than the whole vehicle.
    fold_m = round(min(fold_m, arm_m - (guard_m + 0.002) * math.sqrt(2.0)), 3)
    springs: Part = {
        "stiffness_per_s2": round(rad_s**2, 1),
        "damping_per_s": round(2.0 * draw.number(*RANGES["spring_damping"]) * rad_s, 1),
        "fold_max_m": fold_m,
        "hysteresis_m": round(fold_m / 15.0, 4),
    }
    return {
        **(springs if kind == "foldable" else {}),
        "tip_mass_kg": round(0.6 * yaw_kg_m2 / (4.0 * arm_m**2), 4),
        "stop": {
            "contact_time_s": draw.number(*RANGES["stop_time_s"][kind]),
            "restitution": draw.number(*RANGES["restitution"][kind]),
        },
    }


def companion_settings(airframe: Airframe) -> Part:
    """What its owner writes into `companion:`, from a ruler, a scale and the IMU's data sheet."""
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
    """The airframe of that name or file, or of a seed the vehicle of its kind that is drawn from it.

    Reading an airframe's file takes longer than flying a hit with it.
    """
    if seed is None:
        airframe = load_world(None, (), kind, None).airframe
        return BenchVehicle(airframe, {"estimate": {"guards": guards_of(airframe)}})
    airframe = Airframe.model_validate(with_base(drawn_vehicle(seed, kind)))
    return BenchVehicle(airframe, companion_settings(airframe))
