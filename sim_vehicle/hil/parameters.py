"""PX4's parameters for one of our airframes: control allocation, hover thrust, gains, and what a flight needs.

Gains give the closed loops that the airframe file states for the built-in autopilot, so that what differs
between the two is PX4 and not its tuning.
"""

import math
from collections.abc import Iterable
from typing import Literal

import numpy as np

from sim_vehicle.airframe import Airframe
from sim_vehicle.parameters.sitl import Parameter, same_for_all
from sim_vehicle.physics.layout import allocation, arms_of

# MAV_PARAM_TYPE, as a .params file writes it.
_INT32, _REAL32 = 6, 9

_FIRST_MOTOR_FUNCTION = 101
# As PX4's airframe files name them.
_PX4_TYPES = {4: "Quadrotor", 6: "Hexarotor", 8: "Octorotor"}

# FILTER_UPDATE_PERIOD of PX4's EKF2: its noises are standard deviations over one such step.
EKF_PERIOD_S = 0.01

Position = Literal["mocap", "gps", "flow"]


def px4_parameters(airframe: Airframe, position: Position = "mocap") -> tuple[Parameter, ...]:
    """Everything that must differ from PX4's airframe 10016 (none_iris); ``position``: what PX4 flies by."""
    return (
        *_allocation(airframe),
        *_gains(airframe),
        *_limits(airframe),
        *_sensors(airframe, position),
        *same_for_all("px4", "flight rules"),
    )


def _allocation(airframe: Airframe) -> Iterable[Parameter]:
    moment_m = airframe.motors.moment_per_thrust_m
    yield from same_for_all("px4", "allocation")
    yield Parameter("CA_ROTOR_COUNT", airframe.rotor_count, "in PX4's order")
    for rotor, (direction, radius_m, sign) in enumerate(zip(*arms_of(airframe), strict=True)):
        yield Parameter(f"CA_ROTOR{rotor}_PX", float(radius_m * direction[0]), "motor, metres ahead of the centre")
        yield Parameter(f"CA_ROTOR{rotor}_PY", float(radius_m * direction[1]), "metres to the right")
        yield Parameter(f"CA_ROTOR{rotor}_KM", float(sign * moment_m), "reaction torque over thrust, metres")
        yield Parameter(f"PWM_MAIN_FUNC{rotor + 1}", _FIRST_MOTOR_FUNCTION + rotor, "the motor's output")


def _greatest_moments_n_m(airframe: Airframe) -> tuple[float, float]:
    """What PX4 takes for a torque setpoint of 1, of roll and pitch, and of yaw.

    It scales the columns of its pseudo-inverse: roll and pitch by the larger root of a column's sum of squares over
    half of its entries that are not zero, yaw by its largest entry (ControlAllocationPseudoInverse.cpp).
    """
    mix, roll_lever_m, yaw_lever_m = allocation(airframe)
    halves = np.maximum(np.count_nonzero(np.abs(mix[:, :2]) > 1e-6, axis=0), 1) / 2
    roll_scale = float(np.sqrt((mix[:, :2] ** 2).sum(axis=0) / halves).max()) / roll_lever_m
    yaw_scale = float(np.abs(mix[:, 2]).max()) / yaw_lever_m
    return airframe.motors.max_thrust_n / roll_scale, airframe.motors.max_thrust_n / yaw_scale


def _gains(airframe: Airframe) -> Iterable[Parameter]:
    """Attitude as a cascade: w^2 and 2 z w of the airframe's loop are P_angle * P_rate and P_rate."""
    control, motors = airframe.control, airframe.motors
    moments_n_m = _greatest_moments_n_m(airframe)
    jx, jy, jz = airframe.inertia_kg_m2
    rate_per_s = 2 * control.attitude_damping * control.attitude_frequency_rad_s
    for axis, inertia in (("ROLL", jx), ("PITCH", jy)):
        per_unit = moments_n_m[0] / inertia
        p = rate_per_s / per_unit
        yield Parameter(f"MC_{axis}RATE_P", p, f"rate loop of {rate_per_s:.0f} 1/s")
        yield Parameter(f"MC_{axis}RATE_I", p, "trim within a second")
        yield Parameter(f"MC_{axis}RATE_D", p * motors.time_constant_s / 2, "half of the motors' lag")
        yield Parameter(f"MC_{axis}_P", control.attitude_frequency_rad_s / (2 * control.attitude_damping), "1/s")
    # A vehicle that a hit tips by more than half a radian is turned back as fast as by the built-in autopilot.
    fastest_deg_s = math.degrees(control.attitude_frequency_rad_s / (2 * control.attitude_damping))
    yield Parameter("MC_ROLLRATE_MAX", fastest_deg_s, "deg/s; 220 turns a tipped vehicle back too slowly")
    yield Parameter("MC_PITCHRATE_MAX", fastest_deg_s, "the same")
    yaw_rate_per_s = 2 * control.attitude_damping * control.yaw_frequency_rad_s
    per_unit = moments_n_m[1] / jz
    yield Parameter("MC_YAWRATE_P", yaw_rate_per_s / per_unit, f"rate loop of {yaw_rate_per_s:.0f} 1/s")
    yield Parameter("MC_YAWRATE_I", yaw_rate_per_s / per_unit, "trim within a second")
    yield Parameter("MC_YAW_P", control.yaw_frequency_rad_s / (2 * control.attitude_damping), "1/s")


def _limits(airframe: Airframe) -> Iterable[Parameter]:
    control = airframe.control
    tilt_deg = math.degrees(control.tilt_max_rad)
    yield from same_for_all("px4", "limits")
    yield Parameter("MPC_THR_HOVER", airframe.hover_fraction, "weight over greatest thrust")
    yield Parameter("MPC_TILTMAX_AIR", tilt_deg, "degrees; more would not carry the weight")
    yield Parameter("MPC_MAN_TILT_MAX", tilt_deg, "the same for a pilot")
    yield Parameter("MPC_XY_P", control.position_p_per_s, "1/s; eq. 6, as for the built-in autopilot")
    yield Parameter("MPC_XY_VEL_P_ACC", control.velocity_p_per_s, "1/s; the same")
    yield Parameter("MPC_XY_VEL_I_ACC", control.velocity_i_per_s2, "1/s2; the same")
    yield Parameter("MPC_XY_VEL_D_ACC", control.velocity_d, "the same")


def _sensors(airframe: Airframe, position: Position) -> Iterable[Parameter]:
    interval_us = airframe.imu.integration_interval_us
    yield Parameter("IMU_INTEG_RATE", round(1e6 / interval_us), "one HIGHRES_IMU a sample of the simulator")
    yield from same_for_all("px4", "sensors")
    gyroscope_noise_rad_s = airframe.imu.gyroscope_noise_rad_s * math.sqrt(1e-6 * interval_us / EKF_PERIOD_S)
    yield Parameter("EKF2_GYR_NOISE", gyroscope_noise_rad_s, "rad/s; the gyroscope's own, over a step of EKF2")
    yield from same_for_all("px4", position)
    if position == "flow":
        sensors = airframe.sensors
        yield Parameter("EKF2_MIN_RNG", airframe.geometry.foot_depth_m, "m; what it shows on the ground")
        yield Parameter("SENS_FLOW_MAXHGT", sensors.optical_flow.distance_max_m, "m")
        yield Parameter("SENS_FLOW_MAXR", sensors.optical_flow.rate_max_rad_s, "rad/s")
        # On the ground the camera is out of focus and reports a low quality. Above this limit PX4 would not use it, and
        # not arm.
        yield Parameter("SENS_FLOW_MINHGT", airframe.geometry.foot_depth_m / 2, "m; less than on the ground")


def as_environment(airframe: Airframe, position: Position = "mocap") -> str:
    """Lines for a shell: PX4's SITL start script sets every PX4_PARAM_<NAME> that it finds."""
    lines = [f"# PX4 SITL parameters of '{airframe.name}': source this, then start PX4 from the same shell."]
    lines += [f"export PX4_PARAM_{p.name}={p.text}  # {p.reason}" for p in px4_parameters(airframe, position)]
    return "\n".join(lines)


def as_params_file(airframe: Airframe, position: Position = "mocap") -> str:
    """A file that QGroundControl and `param load`'s users read: system, component, name, value, type."""
    lines = [f"# PX4 parameters of '{airframe.name}'", "# Vehicle-Id Component-Id Name Value Type"]
    for p in px4_parameters(airframe, position):
        lines.append(f"1\t1\t{p.name}\t{p.text}\t{_INT32 if isinstance(p.value, int) else _REAL32}")
    return "\n".join(lines)


def as_airframe_file(airframe: Airframe, position: Position = "mocap") -> str:
    """A file for PX4's ROMFS/px4fmu_common/init.d-posix/airframes/."""
    described = f"# @name {airframe.name}: {airframe.description}"
    kind = f"# @type {_PX4_TYPES[airframe.rotor_count]} x"
    lines = ["#!/bin/sh", "#", described, "#", kind, "#", "", ". ${R}etc/init.d/rc.mc_defaults", ""]
    lines += [f"param set-default {p.name} {p.text}  # {p.reason}" for p in px4_parameters(airframe, position)]
    return "\n".join(lines)
