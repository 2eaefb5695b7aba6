"""How Copter's parameters have to be for collisions to be survived; each bound with its reason."""

import math
from collections.abc import Callable, Iterator, Mapping

from companion.autopilot.setup import PreflightItem, Setup, judged, judged_loss, judged_settings

# For so long Copter flies the last attitude or velocity on.
LOSS = "GUID_TIMEOUT"
OPTIONS = "GUID_OPTIONS"
FILTER = "INS_ACCEL_FILTER"
# GUID_OPTIONS: what SET_ATTITUDE_TARGET has as thrust is thrust, and no climb rate.
THRUST_IS_THRUST = 8
# FRAME_CLASS, for the rotors that MAV_TYPE announces (AP_Motors_Class.h).
CLASSES = {1: "quadrotor", 2: "hexarotor", 3: "octorotor", 4: "octorotor", 5: "hexarotor", 7: "tricopter"}
CLASSES |= {12: "dodecarotor", 14: "decarotor"}
# A low-pass of second order makes a pulse of a jump of the velocity. It is so high for each m/s and Hz: 57 m/s^2
# for each m/s at the default, 20 Hz.
PULSE_PER_M_S_HZ = 2.86
# The default: a hit of 0.1 m/s shows with its 5.7 m/s^2.
LEAST_FILTER_HZ = 20.0
# Copter's default, m/s^3: from level to 2.5 m/s^2 in half a second. A recovery by position begins no sooner.
LEAST_JERK_M_S3 = 5.0
# With 17 degrees a vehicle brakes by 3 m/s^2; the rest is for wind. Copter's default is 30.
LEAST_LEAN_DEG, LEAN_DEG = 20.0, 30.0
# From 4.5 on. Copter's mixer takes from the lift what its loop of the yaw rate asks for: half of a command for each
# motor. So much leaves a vehicle that a hit has turned as much lift as PX4's mixer does.
YAW, MOST_YAW = "ATC_RAT_YAW_PDMX", 0.3
# Names that changed with 4.7, newer before older.
JERKS, LEANS = ("PSC_NE_JERK", "PSC_JERK_NE", "PSC_JERK_XY"), ("ATC_ANGLE_MAX", "ANGLE_MAX")
CHECKS = ("ARMING_SKIPCHK", "ARMING_CHECK")
SERIALS, COMPANION_BAUD = range(1, 6), 921_600
# SERIALn_PROTOCOL: MAVLink 1 and 2. SERIALn_BAUD has thousands, by ArduPilot's own rounding.
MAVLINK_1, MAVLINK_2 = 1, 2
BAUDS = {57_600: 57, 115_200: 115, 230_400: 230, 460_800: 460, 500_000: 500, COMPANION_BAUD: 921, 1_500_000: 1500}
OF_A_LINE = tuple(f"SERIAL{number}_{what}" for number in SERIALS for what in ("PROTOCOL", "BAUD"))


def frame(setup: Setup) -> Iterator[PreflightItem]:
    number = setup.parameters.get("FRAME_CLASS")
    if number is not None:
        named, kind = CLASSES.get(int(number), "another frame"), setup.vehicle_type
        remedy = "FRAME_CLASS and FRAME_TYPE in Mission Planner: Setup, Frame Type; then reboot"
        found = f"{number:g} ({named}), MAV_TYPE says {kind}"
        yield judged("FRAME_CLASS", found, named != kind, remedy)


def port(setup: Setup) -> Iterator[PreflightItem]:
    """The port that this line is plugged into, by its baud rate."""
    told, line = setup.parameters, setup.line
    if line is None or line.baud is None:
        return
    wanted = BAUDS.get(line.baud, line.baud // 1000)
    fitting = [number for number in SERIALS if told.get(f"SERIAL{number}_BAUD") == wanted]
    speaking = [n for n in fitting if told.get(f"SERIAL{n}_PROTOCOL") in (MAVLINK_1, MAVLINK_2)]
    if not speaking:
        remedy = f"SERIAL2_PROTOCOL = {MAVLINK_2}, SERIAL2_BAUD as in --connect (921 for {COMPANION_BAUD}); then reboot"
        yield judged("port", f"no port has MAVLink at {line.baud} baud", True, remedy)
        return
    name = f"SERIAL{speaking[0]}"
    remedy = f"{name}_BAUD = 921, reboot, {COMPANION_BAUD} in --connect"
    yield judged("port", f"{name}, {line.baud} baud", line.baud < COMPANION_BAUD, remedy)
    if told[f"{name}_PROTOCOL"] == MAVLINK_1:
        protocol = f"{name}_PROTOCOL"
        found = "MAVLink 1: no stream comes at its rate"
        yield judged(protocol, found, is_bad=True, remedy=f"{protocol} = 2, then reboot", mended=MAVLINK_2)


def _timeout(name: str, timeout_s: float, setup: Setup) -> PreflightItem:
    found = f"{timeout_s:g} s until Copter levels out, or stops, when the companion has died"
    return judged_loss(name, timeout_s, found)


def _options(name: str, bits: float, setup: Setup) -> PreflightItem:
    value = int(bits) | THRUST_IS_THRUST
    found = f"{int(bits)}: an attitude's thrust is " + ("thrust" if int(bits) == value else "a climb rate")
    remedy = f"{name} = {value}, or recoveries are flown by position alone"
    return judged(name, found, int(bits) != value, remedy, mended=value)


def _filter(name: str, edge_hz: float, setup: Setup) -> PreflightItem:
    delay_ms = 1e3 / (math.sqrt(2.0) * math.pi * edge_hz) if edge_hz > 0.0 else 0.0
    found = f"{edge_hz:g} Hz: a hit shows about {delay_ms:.0f} ms late" if edge_hz > 0.0 else "off: hits are missed"
    return judged(name, found, edge_hz < LEAST_FILTER_HZ, f"{name} = {LEAST_FILTER_HZ:g}", mended=LEAST_FILTER_HZ)


def _shaping(name: str, enabled: float, setup: Setup) -> PreflightItem:
    """Shaped, no asked turn is flown: Copter brakes the one that a hit has left, with half of what lifts."""
    found = "an attitude is " + ("shaped: its turn is braked, and height lost" if enabled else "flown as asked")
    return judged(name, found, enabled != 0.0, f"{name} = 0", mended=0)


def _yaw(name: str, most: float, setup: Setup) -> PreflightItem:
    found = f"{most:g}: most of what brakes a turn" if most > 0.0 else "off: to brake a turn takes half of the lift"
    return judged(name, found, not 0.0 < most <= MOST_YAW, f"{name} = {MOST_YAW:g}", mended=MOST_YAW)


def _fence(name: str, enabled: float, setup: Setup) -> PreflightItem:
    found = "its own fence is " + ("on" if enabled else "off")
    remedy = f"{name} = 0, or a fence that holds all of the mission's and its margin"
    beyond = ": a setpoint outside of it is dropped without a word"
    return judged(name, found, enabled != 0.0, remedy, beyond=beyond)


def _crash_check(name: str, enabled: float, setup: Setup) -> PreflightItem:
    found = "a vehicle that lies on its side " + ("stops its motors" if enabled else "keeps its motors running")
    return judged(name, found, enabled == 0.0, f"{name} = 1; a recovery holds it off", mended=1)


def _jerk(name: str, jerk_m_s3: float, setup: Setup) -> PreflightItem:
    found = f"{jerk_m_s3:g} m/s^3: how soon a recovery by position leans"
    return judged(name, found, jerk_m_s3 < LEAST_JERK_M_S3, f"{name} = {LEAST_JERK_M_S3:g} or more")


def _lean(name: str, lean: float, setup: Setup) -> PreflightItem:
    per_degree = 1.0 if name == LEANS[0] else 100.0
    found = f"Copter leans by {lean / per_degree:g} degrees at most"
    return judged(name, found, lean < LEAST_LEAN_DEG * per_degree, f"{name} = {LEAN_DEG * per_degree:g}")


def _checks(name: str, bits: float, setup: Setup) -> PreflightItem:
    all_checks = 0 if name == CHECKS[0] else 1
    found, remedy = f"{bits:g}: checks before arming", f"{name} = {all_checks}, and mend what the check finds"
    return judged(name, found, bits != all_checks, remedy, beyond=" are left out")


_SETTINGS: dict[str, Callable[[str, float, Setup], PreflightItem]] = {
    LOSS: _timeout,
    OPTIONS: _options,
    FILTER: _filter,
    "ATC_RATE_FF_ENAB": _shaping,
    "FENCE_ENABLE": _fence,
    "FS_CRASH_CHECK": _crash_check,
}
PARAMETERS = (*_SETTINGS, YAW, "FRAME_CLASS", *JERKS, *LEANS, *CHECKS, *OF_A_LINE)


def judge_parameters(setup: Setup) -> Iterator[PreflightItem]:
    settings, told = dict(_SETTINGS), setup.parameters
    for names, judge in ((JERKS, _jerk), (LEANS, _lean), (CHECKS, _checks)):
        # Of two names a vehicle tells one.
        settings[next((name for name in names if name in told), names[0])] = judge
    if YAW in told:
        settings[YAW] = _yaw
    return judged_settings(settings, setup)


def sight(setup: Setup) -> PreflightItem:
    """A filtered pulse is 18 ms wide: no hit falls between two samples."""
    edge_hz = float(setup.parameters.get(FILTER) or LEAST_FILTER_HZ)
    slowest_m_s = setup.threshold_m_s2 / (PULSE_PER_M_S_HZ * edge_hz)
    remedy = "a faster HIGHRES_IMU (see above): a pulse is 18 ms wide, and shows in two samples from 100 Hz on"
    found = f"from {slowest_m_s:.2f} m/s on through a filter of {edge_hz:g} Hz; {setup.false_alarms}"
    return judged("smallest hit", found, setup.imu_hz < 100.0, remedy)


def attitude_held_s(told: Mapping[str, int | float]) -> float:
    return float(told[LOSS]) if int(told[OPTIONS]) & THRUST_IS_THRUST else math.inf
