"""ArduPilot's DataFlash logs (.bin, .log) as the samples that PX4's link would have carried; pymavlink reads the file.

Messages and their fields are those of ArduPilot's LogStructure.h files, from Copter 3.1 on: which there are, their
units and their time stamps differ from version to version. Frames are PX4's already: NED, and FRD with a specific
force of -9.81 m/s^2 on z at rest.
"""

import contextlib
import io
import math
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.DFReader import DFReader_binary, DFReader_text
from pymavlink.mavutil import mode_mapping_acm
from pymavlink.quaternion import QuaternionBase

from companion import messages
from companion.autopilot.px4.modes import AUTO_LAND, AUTO_LOITER, OFFBOARD, POSCTL
from rebound_cli.logs.log import (
    QUADROTOR,
    Log,
    LogError,
    LoggedSample,
    heartbeat,
    in_order,
    multicopter,
    slow_velocity,
    vector,
)
from rebound_cli.logs.topic import Floats, Topic

# Each binary message begins with these two bytes; 128 is the type of FMT, whose own begins with a type and a length.
_HEAD = b"\xa3\x95"
_FORMAT = re.compile(re.escape(_HEAD) + b"\x80.(.)", re.DOTALL)
# A text log may begin with some lines of greeting.
_BEGINNING = 8000
_HEADER_SIZE = 3

_NAMES = [
    *("MSG", "PARM", "IMU", "ATT", "CTUN", "VIBE", "GPS", "MODE", "EV", "ERR", "RCIN", "PSCN", "PSCE", "PSCD"),
    *(f"{estimator}{number}" for estimator in ("XKF", "NKF") for number in (1, 4)),
]
# CTUN's climb rates are in cm/s where they are whole numbers.
_CLIMB_RATES = ("DCRt", "CRt")
# What a missing message costs, in the words of docs/how-to/recorded-flights.md.
_COSTS = {
    ("XKF1", "NKF1", "CTUN"): "height and velocity are not known: no v_c, and landings are told by the land detector",
    ("ATT", "XKF1", "NKF1"): "the direction of a hit in the world is not known",
    ("CTUN",): "thrust is not known: hits along body z are judged by the force's own change alone",
    ("EV",): "neither arming nor landing is known: the whole log is taken for a flight",
}

# The name at the head of the firmware's own message, and the MAV_TYPE of those that are no multicopters.
_FIRMWARE = re.compile(r"(?:Ardu|APM:)?(Copter|Plane|Rover|Sub|Blimp|AntennaTracker) ?[vV]\d")
_OTHER_FIRMWARE = {"Plane": 1, "Rover": 10, "Sub": 12, "Blimp": 7, "AntennaTracker": 5}
# FRAME_CLASS to MAV_TYPE (AP_Motors_Class.h). Firmware without it is of one frame, and only helicopters are told here.
_HELICOPTER = 4
_FRAMES = {2: 13, 3: 14, 4: 14, 5: 13, 6: 4, 7: 15, 8: 3, 9: 3, 10: 23, 11: 4, 12: 29, 13: 4, 14: 35}

# Copter's modes (ArduCopter/mode.h; pymavlink has their numbers) to the modes of PX4 that do the same. By what sticks
# ask for: STABILIZED, an attitude and a thrust; ALTCTL, an attitude and a climb rate; POSCTL, a velocity.
_MANUAL, _ALTCTL, _ACRO, _STABILIZED = (main << 16 for main in (1, 2, 5, 7))
_AUTO_TAKEOFF, _AUTO_MISSION, _AUTO_RTL, _AUTO_FOLLOW = (4 << 16 | sub << 24 for sub in (2, 4, 5, 8))
_MODES = {
    mode: px4
    for px4, modes in (
        (_MANUAL, "TURTLE"),
        # Until 3.2 POSITION holds its place, with the throttle by hand.
        (_STABILIZED, "STABILIZE POSITION DRIFT SYSTEMID"),
        (_ACRO, "ACRO FLIP"),
        (_ALTCTL, "ALT_HOLD SPORT AUTOTUNE"),
        (POSCTL, "LOITER CIRCLE OF_LOITER POSHOLD FLOWHOLD ZIGZAG"),
        (OFFBOARD, "GUIDED GUIDED_NOGPS"),
        (AUTO_LOITER, "BRAKE AVOID_ADSB"),
        (AUTO_LAND, "LAND"),
        (_AUTO_TAKEOFF, "THROW"),
        (_AUTO_MISSION, "AUTO"),
        (_AUTO_RTL, "RTL SMART_RTL AUTO_RTL"),
        (_AUTO_FOLLOW, "FOLLOW"),
    )
    for mode in modes.split()
}
_MODE_NUMBERS = {name.replace("_", ""): number for number, name in mode_mapping_acm.items()}

# EV.Id (LogEvent in AP_Logger.h).
_ARMED, _DISARMED, _LAND_COMPLETE, _NOT_LANDED = 10, 11, 18, 28
_LANDED = dict.fromkeys((_ARMED, _DISARMED, _LAND_COMPLETE), messages.LandedState.ON_GROUND)
_LANDED[_NOT_LANDED] = messages.LandedState.IN_AIR
# By ERR.Subsys (LogErrorSubsystem); ECode 0 says that it is over.
_TROUBLES = [
    *("unknown", "main loop", "radio", "compass", "optical flow", "radio failsafe", "battery failsafe"),
    *("GPS failsafe", "ground station failsafe", "fence", "mode refused", "GPS", "crash check", "flip", "autotune"),
    *("parachute", "EKF check", "EKF failsafe", "barometer", "CPU", "ADS-B failsafe", "terrain data", "navigation"),
    *("terrain failsafe", "EKF primary", "thrust loss", "sensor failsafe", "leak", "pilot input"),
    *("vibration failsafe", "internal error", "dead reckoning failsafe"),
]
_EKF_CHECK = _TROUBLES.index("EKF check")
# GPS.Status
_FIX_3D = 3
# On the mean sphere, 6371 km.
_METRES_PER_DEGREE = math.radians(6_371_000.0)
# AHRS_EKF_TYPE to that estimator's message. The one before them, EKF1, ran without being used until 3.2.
_ESTIMATORS = {2: "NKF1", 3: "XKF1"}
# The estimator's own word, SS (nav_filter_status): horizontal and vertical velocity are good.
_GOOD = {"horizontal velocity": 2, "vertical velocity": 4}
# INS_ACCEL_FILTER's default, and what 0 means to INS_MPU6K_FILTER, which had this place until 3.3.
_LOW_PASS_HZ = 20.0
# Channels of the sticks and their ends, where the log does not hold RCMAP_x and RCn_MIN, TRIM and MAX.
_STICKS = (("PITCH", 2), ("ROLL", 1), ("THROTTLE", 3), ("YAW", 4))
_ENDS = (("MIN", 1100.0), ("TRIM", 1500.0), ("MAX", 1900.0))

_Topics = Mapping[str, Topic]
_Parameters = Mapping[str, float]


class _Binary(DFReader_binary):  # type: ignore[misc]  # pymavlink has no types
    def init_clock(self) -> None:
        """Stamps are taken as they stand: no search through the whole log for the time of day."""

    def init_arrays_fast(self, progress_callback: None = None) -> None:
        """The compiled index is no faster, and prints what it complains of where nothing can catch it."""
        self.init_arrays(progress_callback)


class _Text(DFReader_text):  # type: ignore[misc]
    def init_clock(self) -> None:
        """As above."""


def read_dataflash(path: Path) -> Log:
    """Raises LogError."""
    try:
        # It prints its warnings.
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            topics, texts, parameters = _content(path)
    except LogError:
        raise
    except Exception as error:  # damaged files make it raise whatever the bytes led to
        text = " ".join(str(error).split()) or type(error).__name__
        raise LogError(f"{path}: not a readable ArduPilot log: {text}.") from error
    vehicle = _vehicle(path, texts, parameters)
    imu = topics["IMU"]
    if not imu.rate_hz():
        raise LogError(f"{path}: no IMU samples with times in it; Copter logs them by default since 3.1 (LOG_BITMASK).")
    estimator, estimate = _estimate(topics, parameters)
    estimate = _while_good(estimate, topics["ERR"])
    heard = [
        *_imu_samples(imu),
        *_local_position(estimate),
        *_attitude(topics["ATT"] or estimate),
        *_attitude_targets(topics["CTUN"], topics["ATT"]),
        *_vibration(topics["VIBE"]),
        *_heartbeats(topics["EV"], topics["MODE"]),
        *_landed_states(topics["EV"], int(imu.time_us[0])),
        *_sticks(topics["RCIN"], parameters),
        *_demand(topics["PSCD"] or topics["CTUN"]),
    ]
    low_pass_hz = parameters.get("INS_ACCEL_FILTER", parameters.get("INS_MPU6K_FILTER", 0.0))
    log = Log(
        path=path,
        vehicle=vehicle,
        started_at_us=int(imu.time_us[0]),
        heard=in_order(heard, float(np.median(imu.time_us))),
        losses=(),
        low_pass_hz=low_pass_hz if low_pass_hz >= 1.0 else _LOW_PASS_HZ,
        marks=tuple(_marks(topics["ERR"])),
    )
    return replace(log, losses=tuple(_losses(topics, estimator, estimate, log.window_us)))


def _content(path: Path) -> tuple[_Topics, Sequence[str], _Parameters]:
    """Columns of numbers, the vehicle's own texts and its parameters, each as last told."""
    content = path.read_bytes()
    if _HEAD in content[:_BEGINNING]:
        # A message of no length would be read for ever.
        if any(length[0] < _HEADER_SIZE for length in _FORMAT.findall(content)):
            raise LogError(f"{path}: the log is damaged: a message in it has no length.")
        reader = _Binary(str(path))
    elif b"FMT," in content[:_BEGINNING]:
        reader = _Text(str(path))
    else:
        raise LogError(f"{path}: not a log of ArduPilot: no message format at its beginning.")
    columns: dict[str, tuple[tuple[str, ...], array[float]]] = {}
    texts, parameters, now_us = [], {}, 0
    with reader:
        while (message := reader.recv_match(type=set(_NAMES), strict=True)) is not None:
            try:
                row = message.to_dict()
            except ValueError:
                continue  # a damaged line of text
            name = row.pop("mavpackettype")
            # Until 3.2 an event has no stamp: it is as old as the message before it.
            now_us = _stamp_us(name, row) or now_us
            if name == "MSG":
                texts.append(str(row.get("Message", "")))
            elif name == "PARM":
                if math.isfinite(value := row.get("Value", math.nan)):
                    parameters[str(row.get("Name"))] = float(value)
            elif row.get("I", 0) == 0:  # the first instance of each sensor
                fields, values = columns.setdefault(name, (("timestamp", *row), array("d")))
                if fields[1:] == tuple(row):
                    values.extend([now_us, *(_number(name, field, value) for field, value in row.items())])
    # What was told before the first IMU sample, in part without a stamp, is known by then.
    started_us = columns["IMU"][1][0] if "IMU" in columns else 0.0
    nothing = ("timestamp",), array("d")
    return {name: _topic(*columns.get(name, nothing), started_us) for name in _NAMES}, texts, parameters


def _stamp_us(name: str, row: Mapping[str, Any]) -> int:
    """0 where there is none. Until 3.3 TimeMS of GPS is the satellites', and T is ours."""
    if "TimeUS" in row:
        return int(row["TimeUS"])
    return 1000 * int(row.get("T" if name == "GPS" else "TimeMS", 0))


def _number(name: str, field: str, value: object) -> float:
    """NaN for a text, but a mode by its name."""
    if isinstance(value, str) and name == "MODE":
        return int(value) if value.isdigit() else _MODE_NUMBERS.get(value.upper().replace("_", ""), math.nan)
    if not isinstance(value, int | float):
        return math.nan
    return value / 100 if field in _CLIMB_RATES and isinstance(value, int) else value


def _topic(fields: Sequence[str], values: Sequence[float], started_us: float) -> Topic:
    stamps, *columns = np.reshape(values, (-1, len(fields))).T
    return Topic({"timestamp": np.maximum(stamps, started_us)} | dict(zip(fields[1:], columns, strict=True)))


def _vehicle(path: Path, texts: Sequence[str], parameters: _Parameters) -> str:
    """Its name. Raises LogError where it is no multicopter."""
    told = next(((text, found[1]) for text in texts if (found := _FIRMWARE.match(text))), None)
    if told is None:
        raise LogError(f"{path}: it does not say what vehicle it is of: no message with ArduPilot's name and version.")
    kind = _OTHER_FIRMWARE.get(told[1]) or _FRAMES.get(int(parameters.get("FRAME_CLASS", 0)), QUADROTOR)
    if any(text.startswith("Frame: HELI") for text in texts):
        kind = _HELICOPTER
    return f"{told[0]}, {multicopter(path, kind).vehicle_type}"


def _estimate(topics: _Topics, parameters: _Parameters) -> tuple[str, Topic]:
    """Position and velocity by which the vehicle flies, and where they are from."""
    flies = _ESTIMATORS.get(int(parameters.get("AHRS_EKF_TYPE", 0)))
    for name in (flies, "XKF1", "NKF1"):
        if name is not None and topics[name]:
            return name, _of_primary(topics[name], topics[_status_of(name)])
    return "CTUN", _inertial_navigation(topics["CTUN"], topics["GPS"])


def _while_good(estimate: Topic, errors: Topic) -> Topic:
    """Without the times in which the vehicle's own check of its EKF failed: it does not fly by it then."""
    column = errors.vector("Subsys", "ECode")
    checks = [] if column is None else [(t, code) for _, t, (part, code) in errors.rows(column) if part == _EKF_CHECK]
    good = np.ones(len(estimate), dtype=bool)
    for (time_us, code), (until_us, _) in pairwise([*checks, (np.inf, 0.0)]):
        good &= not code or (estimate.time_us < time_us) | (estimate.time_us >= until_us)
    return estimate.only(good)


def _status_of(name: str) -> str:
    """XKF4 of XKF1; CTUN has none beside it."""
    return name.replace("1", "4")


def _of_primary(topic: Topic, status: Topic) -> Topic:
    """What the core says that is the primary one by the estimator's status at that time; the first core without it."""
    core, primary = topic.column("C"), status.column("PI")
    if core is None:
        return topic
    return topic.only(core == (0.0 if primary is None else status.held(primary, topic.time_us)[0]))


def _inertial_navigation(throttle: Topic, gps: Topic) -> Topic:
    """Before there was an EKF: height and climb rate as flown by, the rest by GPS; at rest where it never has a fix.

    At the times of the fixes, from the first one on: a velocity of 5 Hz held until the next would jump.
    """
    up, fixes = throttle.vector("Alt", "CRt"), gps.vector("Lat", "Lng", "Spd", "GCrs", "Status")
    if up is None:
        return Topic({"timestamp": np.empty(0)})
    time_us, flat = throttle.time_us, np.zeros((len(throttle), 4))
    if fixes is not None and (fixes[:, 4] >= _FIX_3D).any():
        fixed_us = gps.only(fixes[:, 4] >= _FIX_3D).time_us
        waiting_us = time_us[time_us < fixed_us[0]]
        time_us = np.concatenate([waiting_us, fixed_us])
        latitude_deg, longitude_deg, speed, course_deg, _ = fixes[fixes[:, 4] >= _FIX_3D].T
        north, east = latitude_deg - latitude_deg[0], longitude_deg - longitude_deg[0]
        course_rad, shrinking = np.radians(course_deg), math.cos(math.radians(latitude_deg[0]))
        place = _METRES_PER_DEGREE * north, _METRES_PER_DEGREE * shrinking * east
        fixed = np.column_stack([*place, speed * np.cos(course_rad), speed * np.sin(course_rad)])
        flat = np.concatenate([np.zeros((len(waiting_us), 4)), fixed])
        up, _ = throttle.held(up, time_us)
    fields = dict(zip(("PN", "PE", "VN", "VE", "PD", "VD"), (*flat.T, *-up.T), strict=True))
    return Topic({"timestamp": time_us, **fields})


def _losses(topics: _Topics, estimator: str, estimate: Topic, window_us: float | None) -> Iterator[str]:
    for names, cost in _COSTS.items():
        if not any(topics[name] for name in names):
            yield f"no {' or '.join(names)}: {cost}"
    rate_hz = topics["IMU"].rate_hz()
    if window_us is not None and rate_hz * window_us < 1e6:
        yield (
            f"IMU is logged at {rate_hz:.0f} Hz, and a sample holds the last {window_us / 1e3:.0f} ms: a short contact "
            "can fall between two of them"
        )
    if not estimate:
        return
    yield from slow_velocity(estimator, estimate.rate_hz())
    flags, fixes = topics[_status_of(estimator)].column("SS"), topics["GPS"].column("Status")
    if flags is not None:
        for what, bit in _GOOD.items():
            if share := 100 * float(np.mean(flags.astype(np.int64) & bit == 0)):
                yield f"the {what} is invalid by the estimator's own word for {share:.0f} % of the log: so is v_c"
    elif fixes is None or (fixes < _FIX_3D).any():
        yield "no GPS fix, at least for a time: nothing tells the horizontal velocity, and v_c lacks it"


def _imu_samples(imu: Topic) -> Iterator[LoggedSample]:
    for _, time_us, row in imu.rows(imu.vector("AccX", "AccY", "AccZ", "GyrX", "GyrY", "GyrZ")):
        yield LoggedSample(time_us, messages.ImuSample(time_us, vector(row), vector(row[3:])))


def _local_position(topic: Topic) -> Iterator[LoggedSample]:
    for _, time_us, row in topic.rows(topic.vector("PN", "PE", "PD", "VN", "VE", "VD")):
        yield LoggedSample(time_us, messages.LocalPosition(time_us, vector(row), vector(row[3:])))


def _attitude(topic: Topic) -> Iterator[LoggedSample]:
    for _, time_us, (w, x, y, z) in topic.rows(_quaternions(topic.vector("Roll", "Pitch", "Yaw"))):
        yield LoggedSample(time_us, messages.Attitude(time_us, (w, x, y, z)))


def _quaternions(angles_deg: Floats | None) -> Floats | None:
    """Body to NED, of roll, pitch and yaw."""
    return None if angles_deg is None else np.array([QuaternionBase(row).q for row in np.radians(angles_deg)])


def _attitude_targets(throttle: Topic, attitude: Topic) -> Iterator[LoggedSample]:
    """With the throttle as it was last told: the attitude is logged oftener."""
    thrust, asked = _thrust(throttle), _quaternions(attitude.vector("DesRoll", "DesPitch", "DesYaw"))
    if thrust is None:
        return
    if asked is None:
        for _, time_us, (fraction,) in throttle.rows(thrust[:, None]):
            yield LoggedSample(time_us, messages.AttitudeTarget(time_us, fraction))
        return
    held, is_known = throttle.held(thrust, attitude.time_us)
    held[~is_known] = math.nan
    for _, time_us, (fraction, w, x, y, z) in attitude.rows(np.column_stack([held, asked])):
        yield LoggedSample(time_us, messages.AttitudeTarget(time_us, fraction, (w, x, y, z)))


def _thrust(throttle: Topic) -> Floats | None:
    """In thousandths until 3.4."""
    thousandths = throttle.column("ThrOut")
    return throttle.column("ThO") if thousandths is None else thousandths / 1000.0


def _vibration(topic: Topic) -> Iterator[LoggedSample]:
    """The level is of the primary accelerometer; since 4.0 each has its own messages, with its count alone."""
    number, levels = topic.column("IMU"), topic.vector("VibeX", "VibeY", "VibeZ")
    counts = topic.vector("Clip0", "Clip1", "Clip2") if number is None else topic.vector("Clip")
    if levels is None or counts is None:
        return
    for index, time_us, (x, y, z) in topic.rows(levels):
        if number is None or number[index] == 0:
            first, *others = (int(count) for count in np.nan_to_num(counts[index]))
            second, third = others or (0, 0)
            yield LoggedSample(time_us, messages.Vibration(time_us, 0.0, math.hypot(x, y, z), (first, second, third)))


def _heartbeats(events: Topic, modes: Topic) -> Iterator[LoggedSample]:
    """One at every change of the mode and of what is armed; a log that tells of no arming is of a flight."""
    arming = [(t, int(event)) for _, t, (event,) in events.rows(events.vector("Id")) if event in (_ARMED, _DISARMED)]
    armed, mode = not arming or arming[0][1] == _DISARMED, 0
    numbers = modes.column("ModeNum", "Mode")
    flown = modes.rows(None if numbers is None else numbers[:, None])
    news: list[tuple[int, int | None, int]] = [(time_us, None, int(number)) for _, time_us, (number,) in flown]
    news += [(time_us, event, 0) for time_us, event in arming]
    for time_us, event, number in sorted(news, key=lambda item: item[0]):
        if event is None:
            mode = _MODES.get(mode_mapping_acm.get(number, ""), 0)
        elif event == _ARMED and armed:
            # Most logs of 2014 end with the disarming, before it is written, and go on with the next arming.
            yield LoggedSample(time_us, heartbeat(QUADROTOR, False, mode))
        armed = armed if event is None else event == _ARMED
        yield LoggedSample(time_us, heartbeat(QUADROTOR, armed, mode))


def _landed_states(topic: Topic, started_us: int) -> Iterator[LoggedSample]:
    """By the events of the land detector; one that is armed or disarmed stands on the ground."""
    events = [(t, int(event)) for _, t, (event,) in topic.rows(topic.vector("Id")) if int(event) in _LANDED]
    if events:
        # A take-off would have been told.
        was_in_air = events[0][1] == _LAND_COMPLETE
        before = messages.LandedState.IN_AIR if was_in_air else messages.LandedState.ON_GROUND
        yield LoggedSample(started_us, messages.ExtendedState(before))
    for time_us, event in events:
        yield LoggedSample(time_us, messages.ExtendedState(_LANDED[event]))


def _sticks(topic: Topic, parameters: _Parameters) -> Iterator[LoggedSample]:
    """Each from its lowest pulse over its middle to its highest; forward gives the pitch stick's lowest."""
    columns = []
    for stick, usual in _STICKS:
        channel = int(parameters.get(f"RCMAP_{stick}", usual))
        pulses = topic.column(f"C{channel}")
        if pulses is None:
            return
        # While they had the older name, RC1 to RC4 were of roll, pitch, throttle and yaw, whatever their channels.
        number = channel if "RC1_REVERSED" in parameters else usual
        low, middle, high = (parameters.get(f"RC{number}_{end}", value) for end, value in _ENDS)
        if stick == "THROTTLE" or not low < middle < high:
            middle = (low + high) / 2.0
        is_reversed = parameters.get(f"RC{number}_REV", 1.0) < 0 or parameters.get(f"RC{number}_REVERSED", 0.0) > 0
        sign = -1.0 if is_reversed != (stick == "PITCH") else 1.0
        columns.append(sign * np.interp(pulses, (low, middle, high), (-1.0, 0.0, 1.0)))
    for _, time_us, (pitch, roll, throttle, yaw) in topic.rows(np.column_stack(columns)):
        yield LoggedSample(time_us, messages.Sticks((pitch, roll, throttle, yaw)))


def _demand(topic: Topic) -> Iterator[LoggedSample]:
    """The climb rate that pilot or mission ask for: down in PSCD, up in CTUN."""
    down, up = topic.column("DVD"), topic.column("DCRt")
    if down is None and up is not None:
        down = -up
    for _, time_us, (speed_m_s,) in topic.rows(None if down is None else down[:, None]):
        yield LoggedSample(time_us, messages.PositionTarget(None, speed_m_s))


def _marks(topic: Topic) -> Iterator[tuple[int, str]]:
    for _, time_us, (part, code) in topic.rows(topic.vector("Subsys", "ECode")):
        if code > 0:
            name = _TROUBLES[int(part)] if part < len(_TROUBLES) else f"subsystem {part:.0f}"
            yield time_us, f"{name} (code {code:.0f})"
