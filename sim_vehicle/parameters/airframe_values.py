"""Parameters that describe the vehicle: their defaults from an airframe, and the control that they make."""

import math

from sim_vehicle.airframe import Airframe
from sim_vehicle.geography import Origin, Place
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Vector3

_MICROSECONDS = 1_000_000
# Quadrotor, hexarotor, octorotor.
MAV_TYPES = {4: 2, 6: 13, 8: 14}


def defaults_from(airframe: Airframe) -> dict[str, float]:
    """What ``airframe`` has in place of PX4's defaults; one gain for all axes becomes PX4's two."""
    control = airframe.control
    climb_p_per_s, climb_i_per_s2 = control.climb_gains
    return {
        "COM_OF_LOSS_T": 0.3,  # as `rebound airframe px4` sets it
        "IMU_INTEG_RATE": _MICROSECONDS // airframe.imu.integration_interval_us,
        "MAV_TYPE": MAV_TYPES[airframe.rotor_count],
        "MPC_THR_HOVER": airframe.hover_fraction,
        "MPC_TILTMAX_AIR": math.degrees(control.tilt_max_rad),
        "MPC_XY_P": control.position_p_per_s,
        "MPC_XY_VEL_D_ACC": control.velocity_d,
        "MPC_XY_VEL_I_ACC": control.velocity_i_per_s2,
        "MPC_XY_VEL_MAX": control.speed_max_m_s,
        "MPC_XY_VEL_P_ACC": control.velocity_p_per_s,
        "MPC_Z_P": control.position_p_per_s,
        "MPC_Z_VEL_D_ACC": control.velocity_d,
        "MPC_Z_VEL_I_ACC": climb_i_per_s2,
        "MPC_Z_VEL_MAX_DN": control.descent_max_m_s,
        "MPC_Z_VEL_MAX_UP": control.climb_max_m_s,
        "MPC_Z_VEL_P_ACC": climb_p_per_s,
    }


def with_parameters(airframe: Airframe, parameters: Parameters) -> Airframe:
    """``airframe`` with the inertial sensor that the parameters ask for, in whole raw samples.

    IMU_GYRO_RATEMAX limits IMU_INTEG_RATE, as in PX4.
    """
    rate_hz = min(parameters["IMU_INTEG_RATE"], parameters["IMU_GYRO_RATEMAX"])
    if rate_hz == defaults_from(airframe)["IMU_INTEG_RATE"]:
        return airframe
    raw_us = airframe.imu.raw_interval_us
    interval_us = max(round(_MICROSECONDS / rate_hz / raw_us), 1) * raw_us
    imu = airframe.imu.model_copy(update={"integration_interval_us": interval_us})
    return airframe.model_copy(update={"imu": imu})


def position_gains(parameters: Parameters) -> dict[str, float | Vector3]:
    """What the parameters say now of the position control, by the names of `physics.layout.Gains`."""
    p = parameters
    return {
        "position_p": (p["MPC_XY_P"], p["MPC_XY_P"], p["MPC_Z_P"]),
        "velocity_p": (p["MPC_XY_VEL_P_ACC"], p["MPC_XY_VEL_P_ACC"], p["MPC_Z_VEL_P_ACC"]),
        "velocity_i": (p["MPC_XY_VEL_I_ACC"], p["MPC_XY_VEL_I_ACC"], p["MPC_Z_VEL_I_ACC"]),
        "velocity_d": (p["MPC_XY_VEL_D_ACC"], p["MPC_XY_VEL_D_ACC"], p["MPC_Z_VEL_D_ACC"]),
        "tilt_max_rad": math.radians(p["MPC_TILTMAX_AIR"]),
        "speed_max_m_s": p["MPC_XY_VEL_MAX"],
        "climb_max_m_s": p["MPC_Z_VEL_MAX_UP"],
        "descent_max_m_s": p["MPC_Z_VEL_MAX_DN"],
    }


def origin_of(parameters: Parameters) -> Origin:
    """Where the world lies on the Earth, as PX4's own simulator is told."""
    return Origin(Place(*(parameters[name] for name in ("SIH_LOC_LAT0", "SIH_LOC_LON0", "SIH_LOC_H0"))))
