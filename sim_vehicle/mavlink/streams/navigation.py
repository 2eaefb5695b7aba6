"""Where the vehicle is on the Earth: messages filled as PX4's streams of those names fill them.

Source: PX4's mavlink/streams/*.hpp, one file a message.
"""

import math

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.estimator.estimate import yaw_of
from sim_vehicle.mavlink import framing
from sim_vehicle.mavlink.encode import NAN, Message, boot_ms, units_of
from sim_vehicle.mavlink.telemetry import Telemetry

# What PX4's simulated receiver states (sensor_gps_sim).
_HDOP_CENTI, _VDOP_CENTI, _SPEED_ACCURACY_MM_S = 70, 110, 400
_UNKNOWN_16 = 0xFFFF
# ESTIMATOR_STATUS.flags: everything but "constant position" (bit 7).
_ALL_KNOWN = 0x37F
# Innovation test ratios of a filter that fits its sensors; the built-in estimate has none of its own.
_GOOD_RATIO = 0.05


def global_position_int(state: Telemetry) -> Message:
    estimate = state.published
    v_north, v_east, v_down = estimate.velocity_ned_m_s
    return framing.GLOBAL_POSITION_INT, framing.GLOBAL_POSITION_INT.pack(
        boot_ms(estimate),
        *units_of(state.autopilot.origin.place_at(estimate.position_ned_m)),
        round(1e3 * (state.autopilot.navigator.view.home_ned_m[2] - estimate.position_ned_m[2])),
        _int16(100 * v_north),
        _int16(100 * v_east),
        _int16(100 * v_down),
        _heading_centidegrees(yaw_of(estimate.attitude_wxyz)),
    )


def gps_raw_int(state: Telemetry) -> Message:
    fix = state.slow.gps
    if fix is None or state.autopilot.parameters["SIM_GPS_USED"] < 4:
        satellites = int(state.autopilot.parameters["SIM_GPS_USED"]) if fix is not None else 0
        unknown = (_UNKNOWN_16,) * 4
        return dialect.MAVLink_gps_raw_int_message(state.sample.time_boot_us, 0, 0, 0, 0, *unknown, satellites)
    v_north, v_east, _ = fix.velocity_ned_m_s
    place, accuracy_mm = units_of(fix.place), round(1e3 * fix.accuracy_m)
    return dialect.MAVLink_gps_raw_int_message(
        fix.time_us,
        dialect.GPS_FIX_TYPE_3D_FIX,
        *place,
        _HDOP_CENTI,
        _VDOP_CENTI,
        min(round(100 * math.hypot(v_north, v_east)), _UNKNOWN_16 - 1),
        _heading_centidegrees(math.atan2(v_east, v_north)),
        int(state.autopilot.parameters["SIM_GPS_USED"]),
        place[2],
        accuracy_mm,
        accuracy_mm,
        _SPEED_ACCURACY_MM_S,
    )


def gps_global_origin(state: Telemetry) -> Message:
    return dialect.MAVLink_gps_global_origin_message(*units_of(state.autopilot.origin.place), 0)


def home_position(state: Telemetry) -> Message:
    navigator = state.autopilot.navigator
    home, yaw = navigator.view.home_ned_m, navigator.view.home_yaw_rad
    return dialect.MAVLink_home_position_message(
        *units_of(state.autopilot.origin.place_at(home)),
        *home,
        (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)),
        0.0,
        0.0,
        0.0,
        navigator.home_set_us,
    )


def altitude(state: Telemetry) -> Message:
    """Without a range finder nothing is known of the terrain."""
    height_m = -state.published.position_ned_m[2]
    origin_m = state.autopilot.origin.place.altitude_m
    seen = state.range.distance_m if state.range is not None else None
    return dialect.MAVLink_altitude_message(
        state.published.time_boot_us,
        state.slow.air.altitude_m if state.slow.air is not None else NAN,
        origin_m + height_m,
        height_m,
        height_m + state.autopilot.navigator.view.home_ned_m[2],
        NAN if seen is None else height_m - seen,
        NAN if seen is None else seen,
    )


def vfr_hud(state: Telemetry) -> Message:
    """No airspeed is measured."""
    estimate = state.published
    v_north, v_east, v_down = estimate.velocity_ned_m_s
    return dialect.MAVLink_vfr_hud_message(
        NAN,
        math.hypot(v_north, v_east),
        int(_heading_centidegrees(yaw_of(estimate.attitude_wxyz)) / 100),
        int(100 * estimate.thrust_fraction) if state.autopilot.arming.armed else 0,
        state.autopilot.origin.place.altitude_m - estimate.position_ned_m[2],
        -v_down,
    )


def estimator_status(state: Telemetry) -> Message:
    return dialect.MAVLink_estimator_status_message(
        state.published.time_boot_us,
        _ALL_KNOWN,
        *([_GOOD_RATIO] * 5),
        NAN,
        math.sqrt(2 * state.position_variance_m2),
        math.sqrt(state.position_variance_m2),
    )


def _heading_centidegrees(yaw_rad: float) -> int:
    return int(100 * math.degrees(yaw_rad % (2 * math.pi))) % 36_000


def _int16(value: float) -> int:
    return min(max(round(value), -32_768), 32_767)
