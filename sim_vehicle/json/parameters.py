"""ArduPilot's parameters for one of our airframes: motors, hover thrust, gains, and what a flight needs.

Gains give the closed loops that the airframe file states for the built-in autopilot, as those for PX4 do.
"""

import math
from collections.abc import Iterable

from sim_vehicle.airframe import Airframe
from sim_vehicle.hil.parameters import Parameter
from sim_vehicle.json.messages import FULL_US, STOPPED_US

# By a command of 1 of roll, pitch or yaw each motor of a quad-x has so much of its thrust more or less
# (AP_MotorsMatrix::normalise_rpy_factors).
_MOTOR_SHARE = 0.5


def ardupilot_parameters(airframe: Airframe) -> tuple[Parameter, ...]:
    """Everything that must differ from Copter's defaults, by the names of 4.8."""
    return (*_motors(airframe), *_gains(airframe), *_setpoints(airframe), *_flight_rules(), *_estimator(), *_sensors())


def _motors(airframe: Airframe) -> Iterable[Parameter]:
    hover = airframe.hover_fraction
    yield Parameter("FRAME_CLASS", 1, "quadrotor")
    yield Parameter("FRAME_TYPE", 1, "X")
    yield Parameter("MOT_PWM_MIN", STOPPED_US, "microseconds; the motors stand")
    yield Parameter("MOT_PWM_MAX", FULL_US, "microseconds; full thrust")
    yield Parameter("MOT_SPIN_ARM", 0.0, "thrust begins with the pulse")
    yield Parameter("MOT_SPIN_MIN", 0.0, "the same")
    yield Parameter("MOT_SPIN_MAX", 1.0, "and ends with it")
    yield Parameter("MOT_THST_EXPO", 0.0, "thrust is linear in the pulse")
    yield Parameter("MOT_THST_HOVER", hover, "weight over greatest thrust")
    yield Parameter("MOT_HOVER_LEARN", 0, "it is known")
    yield Parameter("MOT_BAT_VOLT_MAX", 0.0, "V; 0: thrust does not depend on the battery")


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
    yield Parameter("ATC_RAT_YAW_PDMX", 0.3, "to brake a turn, the most that leaves enough to lift with")
    yield Parameter("ATC_RAT_YAW_I", yaw_p / 10, "a tenth, as ArduPilot has it")
    yield Parameter("ATC_ANG_YAW_P", control.yaw_frequency_rad_s / (2 * control.attitude_damping), "1/s")
    hover = airframe.hover_fraction
    yield Parameter("PSC_D_ACC_P", hover / 10, "thrust for each m/s2: a tenth of hover's")
    yield Parameter("PSC_D_ACC_I", hover / 5, "twice as much a second, as ArduPilot has it")


def _setpoints(airframe: Airframe) -> Iterable[Parameter]:
    tilt_deg = math.degrees(airframe.control.tilt_max_rad)
    yield Parameter("GUID_OPTIONS", 8, "an attitude's thrust is thrust")
    yield Parameter("GUID_TIMEOUT", 0.3, "s; a companion that dies leaves an attitude, safe to hold for so long")
    yield Parameter(
        "ATC_RATE_FF_ENAB", 0, "an attitude and its turn are flown as asked; shaped, each turn is braked first"
    )
    yield Parameter("ATC_ANGLE_MAX", tilt_deg, "degrees; more would not carry the weight")


def _flight_rules() -> Iterable[Parameter]:
    yield Parameter("FENCE_ENABLE", 0, "a setpoint outside of it would be dropped")
    yield Parameter("FS_THR_ENABLE", 0, "no radio")
    yield Parameter("FS_GCS_ENABLE", 0, "no ground station needed")
    yield Parameter("BATT_MONITOR", 0, "no battery in a simulation")
    yield Parameter("LOG_BACKEND_TYPE", 0, "the simulation has its own log")


def _estimator() -> Iterable[Parameter]:
    """A hit that clips the accelerometer leaves the velocity wrong by all of it: satellites put it right, and soon."""
    yield Parameter("EK3_ACC_P_NSE", 1.0, "m/s2; leaves room for what a hit hides from the accelerometer")
    for name in ("EK3_VELNE_M_NSE", "EK3_VELD_M_NSE", "EK3_POSNE_M_NSE"):
        yield Parameter(name, 0.1, "m/s, m; the fix is an RTK receiver's")
    for name in ("EK3_VEL_I_GATE", "EK3_POS_I_GATE"):
        yield Parameter(name, 5000, "hundredths of a standard deviation; a hit must not make the true fix incredible")
    yield Parameter("GPS1_RATE_MS", 100, "ten fixes a second")


def _sensors() -> Iterable[Parameter]:
    """As the SITL simulates them: with these errors a compass and accelerometers are taken for calibrated."""
    for sensor in ("", "2", "3"):
        for axis, offset in (("X", 5), ("Y", 13), ("Z", -18)):
            yield Parameter(f"COMPASS_OFS{sensor}_{axis}", offset, "mG, of the SITL's compasses")
    yield Parameter("SIM_GPS1_HZ", 10, "fixes a second")
    yield Parameter("SIM_OPOS_ALT", 0.0, "m; the motors' thrust is that at sea level")


def as_parameter_file(airframe: Airframe) -> str:
    """What the SITL's --defaults, Mission Planner and MAVProxy read: a name and a value, reasons on their own lines."""
    lines = [f"# ArduPilot parameters of '{airframe.name}'"]
    for p in ardupilot_parameters(airframe):
        lines += [f"# {p.reason}", f"{p.name} {p.text}"]
    return "\n".join(lines)
