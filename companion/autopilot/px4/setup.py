"""How PX4's parameters have to be for collisions to be survived; each bound with its reason."""

import math
from collections.abc import Callable, Iterator

from companion.autopilot.setup import PreflightItem, Setup, judged, judged_loss, judged_settings
from companion.motion.config import GRAVITY_M_S2

# For so long PX4 flies the last setpoint on.
LOSS = "COM_OF_LOSS_T"
INTEGRATION = "IMU_INTEG_RATE"
# PX4's parameters in bits and values (their descriptions in PX4's commander module).
RCL_EXCEPT_OFFBOARD = 4
RC_DISABLED = 4
FLIGHTTERM_OFF = 121212
# COM_OBL_RC_ACT.
LOSS_LAND, LOSS_NEEDS_STICKS, LOSS_DROPS = 4, (0, 1, 2), (6, 7)
LOSS_NAMES = ("position", "altitude", "stabilised", "return", "land", "hold", "terminate", "disarm")
# A contact of a stiff frame (the paper's accelerometer shows 0.001 s), for the share of them that samples see.
STIFF_CONTACT_S = 0.001
# Eq. 2 of the paper: a foldable arm's push begins with b_s v_c, b_s = 30 /s.
FOLDING_DAMPING_PER_S = 30.0
# The least that PX4 documents: a lean of 11 degrees; beyond 10 a hit at 3 m/s tips a vehicle onto what it hits.
LEAST_ACC_HOR_M_S2 = 2.0
# Below PX4's default of 200 a sample is a mean over so long that short contacts vanish in it.
LEAST_INTEG_HZ = 200
# Bit 0 of EKF2_EV_CTRL: EKF2 uses the place that motion capture tells. A hit that clips the accelerometer makes that an
# outlier. By PX4's own 5 and 0.35 a rigid vehicle flew 20 m off after a hit at 4 m/s, by these it rests
# (bench/notes/px4.md).
CAPTURE, CAPTURED_PLACE = "EKF2_EV_CTRL", 1
LEAST_CAPTURED = {"EKF2_EVP_GATE": 50.0, "EKF2_ACC_NOISE": 1.0}
# PX4's names and numbers of serial ports (Tools/serial/generate_config.py), which MAV_n_CONFIG has, and its instances.
PORTS, INSTANCES = {101: "TEL1", 102: "TEL2", 103: "TEL3", 104: "TEL4"}, range(3)
# MAV_n_MODE, and the rate that PX4's guide to companion computers recommends.
ONBOARD, COMPANION_BAUD = 2, 921_600
# With which PX4 arms while a cable is in its USB port.
USB_CHECK, USB_ALLOWED = "CBRK_USB_CHK", 197_848
ROTORS = ("CA_ROTOR_COUNT", *(f"CA_ROTOR{number}_P{axis}" for number in range(4) for axis in "XY"))
OF_A_LINE = (
    *(f"MAV_{number}_{what}" for number in INSTANCES for what in ("CONFIG", "MODE", "RATE", "FORWARD")),
    *(f"SER_{port}_BAUD" for port in PORTS.values()),
)


def rotors(setup: Setup) -> Iterator[PreflightItem]:
    """Where PX4's control allocation has them; before 1.13 it had no such parameters."""
    told = setup.parameters
    if not all(name in told for name in ROTORS):
        return
    count, *places = (float(told[name]) for name in ROTORS)
    rotors = list(zip(places[::2], places[1::2], strict=True))
    kind = setup.vehicle_type
    if kind != "quadrotor" or count != len(rotors):
        others = f"MAV_TYPE says {kind}, CA_ROTOR_COUNT {count:g}"
        yield judged("rotors", others, kind == "quadrotor", "choose the airframe in QGroundControl")
        return
    guards = setup.estimate.guards
    along_m = guards.centre_m / math.sqrt(2)
    off_m = max(math.dist((abs(x), abs(y)), (along_m, along_m)) for x, y in rotors)
    middle_m = sum(math.hypot(*rotor) for rotor in rotors) / count
    remedy = "measure; then correct CA_ROTORn_PX, _PY or companion.estimate.guards.centre_m"
    found = f"{middle_m:.2f} m from the middle by PX4, {guards.centre_m:g} m by companion.estimate.guards"
    beyond = f"; one is {off_m:.2f} m from where that has it"
    # Further off than a guard is wide, surfaces are remembered where they are not.
    yield judged("rotors", found, off_m > guards.radius_m, remedy, beyond=beyond)


def port(setup: Setup) -> Iterator[PreflightItem]:
    """The port of PX4's that this line is plugged into, by its baud rate."""
    told, line = setup.parameters, setup.line
    if line is None:
        return
    if line.baud is None:
        remedy = f"a wire to TELEM2; or {USB_CHECK} = {USB_ALLOWED}, then reboot"
        is_refused = told.get(USB_CHECK) != USB_ALLOWED
        beyond = ": with a cable in it PX4 may not arm"
        yield judged("port", "PX4's USB port", is_refused, remedy, beyond=beyond)
        return
    ports = {number: PORTS.get(int(told.get(f"MAV_{number}_CONFIG", 0)), "") for number in INSTANCES}
    fitting = [number for number, port in ports.items() if port and told.get(f"SER_{port}_BAUD") == line.baud]
    if not fitting:
        remedy = "MAV_1_CONFIG = 102 (TELEM2), SER_TEL2_BAUD as in --connect, MAV_1_MODE = 2; then reboot"
        yield judged("port", f"none of PX4's TELEM ports is told to have {line.baud} baud", True, remedy)
        return
    # Of two with the same rate the one that was meant for this.
    number = next((number for number in fitting if told.get(f"MAV_{number}_MODE") == ONBOARD), fitting[-1])
    port, prefix = ports[number], f"MAV_{number}"
    remedy = f"SER_{port}_BAUD = {COMPANION_BAUD}, reboot, the same in --connect"
    yield judged("port", f"{prefix} on {port}, {line.baud} baud", line.baud < COMPANION_BAUD, remedy)
    wanted = {
        "MODE": (ONBOARD, "not the onboard streams"),
        "RATE": (0, "bytes a second at most; 0 is half of the line"),
        "FORWARD": (1, "texts for the ground station end here"),
    }
    for what, (wish, why) in wanted.items():
        name, value = f"{prefix}_{what}", told.get(f"{prefix}_{what}")
        if value is None:
            yield judged(name, "the vehicle did not tell it", True, "ask again", mended=wish)
            continue
        is_less = value != wish if what != "RATE" else 0 < value < line.baud / 20
        yield judged(name, f"{value:g}", is_less, f"{name} = {wish}, then reboot", mended=wish, beyond=f": {why}")


def _integration(name: str, rate_hz: float, setup: Setup) -> PreflightItem:
    mean_ms = 1e3 / rate_hz if rate_hz > 0.0 else math.inf
    found = f"{rate_hz:g} Hz: each sample is a mean over {mean_ms:.1f} ms"
    if rate_hz < LEAST_INTEG_HZ:
        remedy = f"{name} = {LEAST_INTEG_HZ}, then reboot"
        return judged(name, found, True, remedy, mended=LEAST_INTEG_HZ)
    is_long = 1.0 / rate_hz > setup.estimate.imu_averaging_interval_s
    remedy = f"companion.estimate.imu_averaging_interval_s: {1.0 / rate_hz:.4f} in the mission"
    return judged(name, found, is_long, remedy)


def _offboard_loss_time(name: str, loss_s: float, setup: Setup) -> PreflightItem:
    found = f"{loss_s:g} s until PX4 acts when the companion has died"
    cost = "; a program that streams at less than 4 Hz then loses OFFBOARD"
    return judged_loss(name, loss_s, found, cost)


def _offboard_loss(name: str, action: float, setup: Setup) -> PreflightItem:
    number = int(action)
    called = LOSS_NAMES[number] if 0 <= number < len(LOSS_NAMES) else "unknown"
    remedy = f"{name} = {LOSS_LAND} (land)"
    drops, needs_sticks = number in LOSS_DROPS, number in LOSS_NEEDS_STICKS
    beyond = ": the vehicle would fall" if drops else "; without sticks PX4 sinks and drifts, or returns"
    found = f"{number} ({called}) when setpoints stop"
    return judged(name, found, needs_sticks, remedy, is_bad=drops, mended=LOSS_LAND, beyond=beyond)


def _radio(name: str, bits: float, setup: Setup) -> PreflightItem:
    if setup.parameters.get("COM_RC_IN_MODE") == RC_DISABLED:
        return judged(name, "no radio is expected (COM_RC_IN_MODE 4)")
    if int(bits) & RCL_EXCEPT_OFFBOARD:
        return judged(name, "a lost radio does not end OFFBOARD")
    value = int(bits) | RCL_EXCEPT_OFFBOARD
    found = f"{int(bits)}: a lost radio ends OFFBOARD, in the middle of a recovery too"
    remedy = f"{name} = {value}, if the flight may go on without a radio"
    return judged(name, found, True, remedy, mended=value)


def _termination(name: str, breaker: float, setup: Setup) -> PreflightItem:
    if breaker == FLIGHTTERM_OFF:
        return judged(name, "a hit that tips the vehicle does not stop its motors")
    found = f"{breaker:g}: the failure detector stops the motors beyond FD_FAIL_R, FD_FAIL_P (60 degrees)"
    remedy = f"{name} = {FLIGHTTERM_OFF}, unless a parachute or people below ask for it"
    return judged(name, found, True, remedy, mended=FLIGHTTERM_OFF)


def _speeding_up(name: str, most_m_s2: float, setup: Setup) -> PreflightItem:
    """Of PX4's own modes, as `rebound guard` watches them; the companion's setpoints have their own limit."""
    lean_deg = math.degrees(math.atan(most_m_s2 / GRAVITY_M_S2))
    found = f"{most_m_s2:g} m/s^2: PX4's own modes lean by {lean_deg:.0f} degrees as they speed up"
    remedy = f"{name} = {LEAST_ACC_HOR_M_S2:g} for `rebound guard`: a vehicle that leans in tips where it hits"
    return judged(name, found, most_m_s2 > LEAST_ACC_HOR_M_S2, remedy, mended=LEAST_ACC_HOR_M_S2)


def _captured(name: str, value: float, setup: Setup) -> PreflightItem:
    least = LEAST_CAPTURED[name]
    remedy = f"{name} = {least:g}; see docs/how-to/px4.md"
    beyond = ": after a hit PX4 takes its true place for an error, and may fly off"
    return judged(name, f"{value:g}", value < least, remedy, mended=least, beyond=beyond)


_SETTINGS: dict[str, Callable[[str, float, Setup], PreflightItem]] = {
    INTEGRATION: _integration,
    LOSS: _offboard_loss_time,
    "COM_OBL_RC_ACT": _offboard_loss,
    "COM_RCL_EXCEPT": _radio,
    "CBRK_FLIGHTTERM": _termination,
    "MPC_ACC_HOR": _speeding_up,
}
PARAMETERS = (*_SETTINGS, "COM_RC_IN_MODE", CAPTURE, *LEAST_CAPTURED, *ROTORS, *OF_A_LINE, USB_CHECK)


def judge_parameters(setup: Setup) -> Iterator[PreflightItem]:
    yield from judged_settings(_SETTINGS, setup)
    if int(setup.parameters.get(CAPTURE, 0)) & CAPTURED_PLACE:
        yield from judged_settings(dict.fromkeys(LEAST_CAPTURED, _captured), setup)


def sight(setup: Setup) -> PreflightItem:
    """By force alone and in the quiet of standing: a flight's vibration is `rebound tune`'s to judge."""
    integ_hz = setup.parameters.get(INTEGRATION) or 1.0 / setup.estimate.imu_averaging_interval_s
    share = min(1.0, setup.imu_hz * (1.0 / integ_hz + STIFF_CONTACT_S))
    folding = f"arms that fold: from {setup.threshold_m_s2 / FOLDING_DAMPING_PER_S:.2f} m/s on"
    stiff = f"stiff frames: {100 * share:.0f} % of 1 ms contacts fall into a sample"
    remedy = "a faster HIGHRES_IMU (see above); what falls between is found later"
    return judged("smallest hit", f"{folding}; {stiff}; {setup.false_alarms}", share <= 0.9, remedy)
