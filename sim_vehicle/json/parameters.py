"""ArduPilot's parameters for one of our airframes: motors, hover thrust, gains, and what a flight needs.

Gains give the closed loops that the airframe file states for the built-in autopilot, as those for PX4 do.
"""

import math
from collections.abc import Iterable

from sim_vehicle.airframe import Airframe
from sim_vehicle.json.messages import FULL_US, STOPPED_US
from sim_vehicle.parameters.sitl import Parameter, same_for_all

# By a command of 1 of roll, pitch or yaw each motor of a quad-x has so much of its thrust more or less
# (AP_MotorsMatrix::normalise_rpy_factors).
_MOTOR_SHARE = 0.5


def ardupilot_parameters(airframe: Airframe) -> tuple[Parameter, ...]:
    """Everything that must differ from Copter's defaults, by the names of 4.8."""
    tilt_deg = math.degrees(airframe.control.tilt_max_rad)
    return (
        *same_for_all("ardupilot", "motors"),
        Parameter("MOT_PWM_MIN", STOPPED_US, "microseconds; the motors stand"),
        Parameter("MOT_PWM_MAX", FULL_US, "microseconds; full thrust"),
        Parameter("MOT_THST_HOVER", airframe.hover_fraction, "weight over greatest thrust"),
        *same_for_all("ardupilot", "gains"),
        *_gains(airframe),
        *same_for_all("ardupilot", "setpoints"),
        Parameter("ATC_ANGLE_MAX", tilt_deg, "degrees; more would not carry the weight"),
        *(one for part in ("flight rules", "estimator", "sensors") for one in same_for_all("ardupilot", part)),
    )


def _gains(airframe: Airframe) -> Iterable[Parameter]:
    control, motors = airframe.control, airframe.motors
    thrust_n = airframe.rotor_count * _MOTOR_SHARE * motors.max_thrust_n
    lever_m = airframe.geometry.motor_radius_m / math.sqrt(2)
    jx, jy, jz = airframe.inertia_kg_m2
    rate_per_s = 2 * control.attitude_damping * control.attitude_frequency_rad_s
    for axis, inertia in (("RLL", jx), ("PIT", jy)):
        p = rate_per_s * inertia / (thrust_n * lever_m)
        yield Parameter(f"ATC_RAT_{axis}_P", p, f"rate loop of {rate_per_s:.0f} 1/s")
        yield Parameter(f"ATC_RAT_{axis}_I", p, "trim within a second")
        yield Parameter(f"ATC_RAT_{axis}_D", p * motors.time_constant_s / 2, "half of the motors' lag")
        yield Parameter(f"ATC_ANG_{axis}_P", control.attitude_frequency_rad_s / (2 * control.attitude_damping), "1/s")
    yaw_rate_per_s = 2 * control.attitude_damping * control.yaw_frequency_rad_s
    yaw_p = yaw_rate_per_s * jz / (thrust_n * motors.moment_per_thrust_m)
    yield Parameter("ATC_RAT_YAW_P", yaw_p, f"rate loop of {yaw_rate_per_s:.0f} 1/s")
    yield Parameter("ATC_RAT_YAW_I", yaw_p / 10, "a tenth, as ArduPilot has it")
    yield Parameter("ATC_ANG_YAW_P", control.yaw_frequency_rad_s / (2 * control.attitude_damping), "1/s")
    hover = airframe.hover_fraction
    yield Parameter("PSC_D_ACC_P", hover / 10, "thrust for each m/s2: a tenth of hover's")
    yield Parameter("PSC_D_ACC_I", hover / 5, "twice as much a second, as ArduPilot has it")


def as_parameter_file(airframe: Airframe) -> str:
    """What the SITL's --defaults, Mission Planner and MAVProxy read: a name and a value, reasons on their own lines."""
    lines = [f"# ArduPilot parameters of '{airframe.name}'"]
    for p in ardupilot_parameters(airframe):
        lines += [f"# {p.reason}", f"{p.name} {p.text}"]
    return "\n".join(lines)
