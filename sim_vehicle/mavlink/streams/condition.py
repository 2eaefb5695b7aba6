"""How the vehicle is: battery, outputs, slow sensors, versions; filled as PX4's streams of those names fill them.

Source: PX4's mavlink/streams/*.hpp; the values of a vehicle at rest are those of a running PX4 SITL.
"""

import math

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.mavlink import framing
from sim_vehicle.mavlink.encode import Message, boot_ms
from sim_vehicle.mavlink.telemetry import Telemetry
from sim_vehicle.quantities import quaternion_from_matrix

# Between v1.16 and v1.17, the PX4 whose behaviour was measured: version 1.17.0, type alpha (64).
FLIGHT_VERSION = 1 << 24 | 17 << 16 | 0 << 8 | 64
# A SITL's: its host's, and its board's; a number for each vehicle of a swarm.
OS_VERSION, BOARD_VERSION, FIRST_UID = 6 << 24 | 1 << 16 | 255, 1, 5_283_920_058_631_409_231
# What PX4 says it can do: missions, parameters as floats and byte by byte, commands as whole numbers, files, attitude
# and local position setpoints, termination, MAVLink 2, fence and rally points.
CAPABILITIES = 0xE8FF
# In place of a git hash, so that nobody takes this vehicle for PX4's own build.
CUSTOM_VERSION = tuple(b"rebound\0")

# MAV_SYS_STATUS_SENSOR as a PX4 SITL at rest has them: gyro, accelerometer, magnetometer, pressure, GPS, position
# control and battery are there; sticks are wanted, too; and this is well beside them.
_PRESENT = 0x1 | 0x2 | 0x4 | 0x8 | 0x20 | 0x4000 | 0x2000000
_RC_RECEIVER, _GPS, _PREARM_CHECK = 0x10000, 0x20, 0x10000000
_WELL = _PRESENT | 0x10 | 0x800 | 0x8000 | 0x200000 | 0x1000000
_EXTENDED_WELL = 0x1
# Packets dropped and errors, and the upper halves of the three bit masks.
_NO_LINK_STATISTICS = (0,) * 8
# COM_RC_IN_MODE: sticks of no kind are expected.
_NO_STICKS = 4
_LOAD_PER_MILLE = 100

_UNKNOWN_16, _MOST_16 = 0xFFFF, 0x7FFF
# SCALED_IMU's unit: a thousandth of standard gravity (PX4's CONSTANTS_ONE_G).
_MILLI_G_M_S2 = 9.80665e-3
_UNKNOWN_CURRENT = -1
_UNKNOWN_TEMPERATURE = 0x7FFF
# PWM of the simulated outputs: off, and from least to greatest.
PWM_OFF_US, PWM_LEAST_US, PWM_SPAN_US = 900, 1000, 1000
OUTPUTS = 16


def sys_status(state: Telemetry) -> Message:
    """Health as PX4's checks see it; the processor's load is a SITL's."""
    autopilot, battery = state.autopilot, state.autopilot.battery
    enabled = _PRESENT if state.autopilot.parameters["COM_RC_IN_MODE"] == _NO_STICKS else _PRESENT | _RC_RECEIVER
    health = _WELL | (_PREARM_CHECK if autopilot.commander.checks_pass else 0)
    if state.slow.gps is None:
        health &= ~_GPS
    return dialect.MAVLink_sys_status_message(
        _PRESENT,
        enabled,
        health,
        _LOAD_PER_MILLE,
        _millivolts(battery.voltage_v),
        _UNKNOWN_CURRENT,
        math.ceil(100 * battery.remaining),
        *_NO_LINK_STATISTICS,
        _EXTENDED_WELL,
    )


def battery_status(state: Telemetry) -> Message:
    """The whole voltage in the first cell's place, as PX4 has it where it knows no single cells."""
    battery = state.autopilot.battery
    voltages = [_millivolts(battery.voltage_v)] + [_UNKNOWN_16] * 9
    return dialect.MAVLink_battery_status_message(
        0,
        dialect.MAV_BATTERY_FUNCTION_ALL,
        dialect.MAV_BATTERY_TYPE_LIPO,
        _UNKNOWN_TEMPERATURE,
        voltages,
        _UNKNOWN_CURRENT,
        0,
        -1,
        round(100 * battery.remaining),
        0,
        dialect.MAV_BATTERY_CHARGE_STATE_OK,
    )


def servo_output_raw(state: Telemetry) -> Message:
    fractions = state.sample.motor_fractions if state.autopilot.arming.armed else ()
    motors = [round(PWM_LEAST_US + PWM_SPAN_US * fraction) for fraction in fractions]
    return dialect.MAVLink_servo_output_raw_message(
        state.sample.time_boot_us & 0xFFFFFFFF, 0, *motors, *([PWM_OFF_US] * (OUTPUTS - len(motors)))
    )


def manual_control(state: Telemetry) -> Message:
    """The sticks that count, whoever's they are (streams/MANUAL_CONTROL.hpp)."""
    sticks = state.autopilot.commander.sticks.sticks
    if sticks is None:
        return dialect.MAVLink_manual_control_message(state.system, 0, 0, 500, 0, 0)
    pitch, roll, yaw = (round(1000 * value) for value in (sticks.pitch, sticks.roll, sticks.yaw))
    return dialect.MAVLink_manual_control_message(state.system, pitch, roll, round(500 * (sticks.throttle + 1)), yaw, 0)


def scaled_pressure(state: Telemetry) -> Message:
    air = state.slow.air
    assert air is not None, "streamed only once there is a sample"
    return dialect.MAVLink_scaled_pressure_message(
        boot_ms(state.sample), air.pressure_hpa, 0.0, round(100 * air.temperature_c)
    )


def scaled_imu(state: Telemetry) -> Message:
    """HIGHRES_IMU's sample: this vehicle's estimator takes no biases off that. PX4 cuts off fractions."""
    sample = state.sample
    force = (int(each / _MILLI_G_M_S2) for each in sample.specific_force_frd_m_s2)
    rates = (int(1e3 * each) for each in sample.angular_velocity_frd_rad_s)
    field = (int(1e3 * each) for each in state.slow.magnetic_field_frd_gauss)
    inertial = (min(max(each, -_MOST_16), _MOST_16) for each in (*force, *rates, *field))
    return dialect.MAVLink_scaled_imu_message(boot_ms(sample), *inertial)


def system_time(state: Telemetry) -> Message:
    time_us = state.sample.time_boot_us
    return dialect.MAVLink_system_time_message(state.epoch_at_boot_us + time_us, boot_ms(state.sample))


def ping(state: Telemetry) -> Message:
    """PX4's own, to everybody; the number counts seconds, which is how often it is sent to a companion."""
    time_us = state.sample.time_boot_us
    return dialect.MAVLink_ping_message(time_us, time_us // 1_000_000, 0, 0)


def autopilot_version(state: Telemetry) -> Message:
    versions = (FLIGHT_VERSION, FLIGHT_VERSION, OS_VERSION, BOARD_VERSION)
    hashes = (CUSTOM_VERSION, CUSTOM_VERSION, (0,) * 8)
    ids = (0, 0, FIRST_UID + state.system - 1, (state.system,) + (0,) * 17)
    return dialect.MAVLink_autopilot_version_message(CAPABILITIES, *versions, *hashes, *ids)


def flight_information(state: Telemetry) -> Message:
    """Times since boot, whatever the fields are called (FLIGHT_INFORMATION.hpp)."""
    arming = state.autopilot.arming
    armed_us = arming.armed_at_us if arming.armed else 0
    taken_off_us = arming.taken_off_at_us if arming.armed and arming.taken_off else 0
    return dialect.MAVLink_flight_information_message(
        boot_ms(state.sample), armed_us, taken_off_us, int(state.autopilot.parameters["COM_FLIGHT_UUID"])
    )


def attitude_target(state: Telemetry) -> Message:
    """The attitude control's setpoint; it has none for the rates."""
    attitude_wxyz = quaternion_from_matrix(state.attitude_setpoint.tolist())
    return framing.ATTITUDE_TARGET, framing.ATTITUDE_TARGET.pack(
        boot_ms(state.sample), *attitude_wxyz, 0.0, 0.0, 0.0, state.sample.thrust_fraction, 0
    )


def _millivolts(voltage_v: float) -> int:
    return min(max(round(1e3 * voltage_v), 0), _UNKNOWN_16 - 1)
