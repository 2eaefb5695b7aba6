"""ArduPilot's DataFlash logs (.bin) as the samples that PX4's link would have carried; pymavlink reads the file.

Messages and their fields are those of ArduPilot's LogStructure.h files, from Copter 4.3 on, as `rebound fly` speaks to.
Frames are PX4's already: NED, and FRD with a specific force of -9.81 m/s^2 on z at rest.
"""

import contextlib
import io
import math
import re
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.DFReader import DFReader_binary
from pymavlink.mavutil import mode_mapping_acm
from pymavlink.quaternion import QuaternionBase

from companion import messages
from companion.autopilot.px4.modes import AUTO_LAND, AUTO_LOITER, OFFBOARD, POSCTL
from companion.messages import Sample, Vector3
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

# Each message begins with these two bytes.
_HEAD = b"\xa3\x95"
_HEADER_SIZE = 3

_NAMES = ("MSG", "PARM", "IMU", "ATT", "CTUN", "MODE", "EV", "PSCD", "XKF1", "XKF4")
# What a missing message costs, in the words of docs/how-to/recorded-flights.md.
_COSTS = {
    "XKF1": "height and velocity are not known: no v_c, and landings are told by the land detector",
    "ATT": "the direction of a hit in the world is not known",
    "CTUN": "thrust is not known: hits along body z are judged by the force's own change alone",
    "EV": "neither arming nor landing is known: the whole log is taken for a flight",
}

# The head of the firmware's own message.
_FIRMWARE = re.compile(r"Ardu\w+ V(\d+)\.(\d+)")
_OLDEST = 4, 3
# FRAME_CLASS to MAV_TYPE (AP_Motors_Class.h).
_FRAMES = {2: 13, 3: 14, 4: 14, 5: 13, 6: 4, 7: 15, 8: 3, 9: 3, 10: 23, 11: 4, 12: 29, 13: 4, 14: 35}

# Copter's modes (ArduCopter/mode.h; pymavlink has their numbers) to the modes of PX4 that do the same. By what sticks
# ask for: STABILIZED, an attitude and a thrust; ALTCTL, an attitude and a climb rate; POSCTL, a velocity.
_MANUAL, _ALTCTL, _ACRO, _STABILIZED = (main << 16 for main in (1, 2, 5, 7))
_AUTO_TAKEOFF, _AUTO_MISSION, _AUTO_RTL, _AUTO_FOLLOW = (4 << 16 | sub << 24 for sub in (2, 4, 5, 8))
_MODES = {
    mode: px4
    for px4, modes in (
        (_MANUAL, "TURTLE"),
        (_STABILIZED, "STABILIZE DRIFT SYSTEMID"),
        (_ACRO, "ACRO FLIP"),
        (_ALTCTL, "ALT_HOLD SPORT AUTOTUNE"),
        (POSCTL, "LOITER CIRCLE POSHOLD FLOWHOLD ZIGZAG"),
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

# EV.Id (LogEvent in AP_Logger.h).
_ARMED, _DISARMED, _LAND_COMPLETE, _NOT_LANDED = 10, 11, 18, 28
_LANDED = dict.fromkeys((_ARMED, _DISARMED, _LAND_COMPLETE), messages.LandedState.ON_GROUND)
_LANDED[_NOT_LANDED] = messages.LandedState.IN_AIR
# The estimator's own word, SS (nav_filter_status): horizontal and vertical velocity are good.
_GOOD = {"horizontal velocity": 2, "vertical velocity": 4}
# INS_ACCEL_FILTER's default.
_LOW_PASS_HZ = 20.0

_Topics = Mapping[str, Topic]
_Parameters = Mapping[str, float]


class _Formats(dict[int, Any]):
    """What messages look like, by their type. One of no length would be read for ever."""

    def __setitem__(self, kind: int, described: Any) -> None:
        if described.len < _HEADER_SIZE:
            raise ValueError("the log is damaged: a message in it has no length")
        super().__setitem__(kind, described)


class _Reader(DFReader_binary):  # type: ignore[misc]  # pymavlink has no types
    formats: dict[int, Any]

    def init_clock(self) -> None:
        """Stamps are taken as they stand: no search through the whole log for the time of day."""

    def init_arrays_fast(self, progress_callback: None = None) -> None:
        """The compiled index is no faster, and prints what it complains of where nothing can catch it."""
        self.formats = _Formats(self.formats)
        self.init_arrays(progress_callback)


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
        raise LogError(f"{path}: no IMU samples with times in it; Copter logs them by default (LOG_BITMASK).")
    estimate = _of_primary(topics["XKF1"], topics["XKF4"])
    heard = [
        *_pairs(messages.ImuSample, imu, "AccX", "AccY", "AccZ", "GyrX", "GyrY", "GyrZ"),
        *_pairs(messages.LocalPosition, estimate, "PN", "PE", "PD", "VN", "VE", "VD"),
        *_attitude(topics["ATT"] or estimate),
        *_attitude_targets(topics["CTUN"], topics["ATT"]),
        *_heartbeats(topics["EV"], topics["MODE"]),
        *_landed_states(topics["EV"], int(imu.time_us[0])),
        *_demand(topics["PSCD"]),
    ]
    low_pass_hz = parameters.get("INS_ACCEL_FILTER", 0.0)
    log = Log(
        path=path,
        vehicle=vehicle,
        started_at_us=int(imu.time_us[0]),
        heard=in_order(heard, float(np.median(imu.time_us))),
        losses=(),
        is_filtered=True,
        low_pass_hz=low_pass_hz if low_pass_hz >= 1.0 else _LOW_PASS_HZ,
    )
    return replace(log, losses=tuple(_losses(topics, estimate, log.window_us)))


def _content(path: Path) -> tuple[_Topics, Sequence[str], _Parameters]:
    """Columns of numbers, the vehicle's own texts and its parameters, each as last told."""
    if not path.read_bytes().startswith(_HEAD):
        raise LogError(f"{path}: not a log of ArduPilot; give the .bin as the vehicle wrote it.")
    columns: dict[str, tuple[tuple[str, ...], array[float]]] = {}
    texts, parameters = [], {}
    with _Reader(str(path)) as reader:
        while (message := reader.recv_match(type=set(_NAMES), strict=True)) is not None:
            row = message.to_dict()
            name = row.pop("mavpackettype")
            if name == "MSG":
                texts.append(str(row.get("Message", "")))
            elif name == "PARM":
                if math.isfinite(value := row.get("Value", math.nan)):
                    parameters[str(row.get("Name"))] = float(value)
            elif "TimeUS" in row and row.get("I", 0) == 0:  # the first instance of each sensor
                fields, values = columns.setdefault(name, (tuple(row), array("d")))
                if fields == tuple(row):
                    values.extend(value if isinstance(value, int | float) else math.nan for value in row.values())
    # What was told before the first IMU sample is known by then.
    started_us = _topic(*columns["IMU"], -math.inf).time_us[0] if "IMU" in columns else 0.0
    nothing = ("TimeUS",), array("d")
    return {name: _topic(*columns.get(name, nothing), started_us) for name in _NAMES}, texts, parameters


def _topic(fields: Sequence[str], values: Sequence[float], started_us: float) -> Topic:
    data = dict(zip(fields, np.reshape(values, (-1, len(fields))).T, strict=True))
    return Topic({"timestamp": np.maximum(data.pop("TimeUS"), started_us)} | data)


def _vehicle(path: Path, texts: Sequence[str], parameters: _Parameters) -> str:
    """Its name. Raises LogError where it is no multicopter, or of a version that has other messages."""
    told = next(((text, found) for text in texts if (found := _FIRMWARE.match(text))), None)
    if told is None:
        raise LogError(f"{path}: it does not say what vehicle it is of: no message with ArduPilot's name and version.")
    text, version = told
    if not text.startswith("ArduCopter") or (int(version[1]), int(version[2])) < _OLDEST:
        raise LogError(f"{path}: it is of {text}; collisions are looked for in logs of ArduCopter 4.3 and later.")
    kind = _FRAMES.get(int(parameters.get("FRAME_CLASS", 0)), QUADROTOR)
    return f"{text}, {multicopter(path, kind).vehicle_type}"


def _of_primary(topic: Topic, status: Topic) -> Topic:
    """What the core says that is the primary one by the estimator's status at that time; the first core without it."""
    core, primary = topic.column("C"), status.column("PI")
    if core is None:
        return topic
    return topic.only(core == (0.0 if primary is None else status.held(primary, topic.time_us)[0]))


def _losses(topics: _Topics, estimate: Topic, window_us: float | None) -> Iterator[str]:
    for name, cost in _COSTS.items():
        if not topics[name]:
            yield f"no {name}: {cost}"
    rate_hz = topics["IMU"].rate_hz()
    if window_us is not None and rate_hz * window_us < 1e6:
        yield (
            f"IMU is logged at {rate_hz:.0f} Hz, and a sample holds the last {window_us / 1e3:.0f} ms: a short contact "
            "can fall between two of them"
        )
    if estimate:
        yield from slow_velocity("XKF1", estimate.rate_hz())
    flags = _of_primary(topics["XKF4"], topics["XKF4"]).column("SS")
    if flags is None or not len(flags):
        return
    for what, bit in _GOOD.items():
        if share := 100 * float(np.mean(flags.astype(np.int64) & bit == 0)):
            yield f"the {what} is invalid by the estimator's own word for {share:.0f} % of the log: so is v_c"


def _pairs(kind: Callable[[int, Vector3, Vector3], Sample], topic: Topic, *names: str) -> Iterator[LoggedSample]:
    """Samples of two vectors, by the names of their parts."""
    for _, time_us, row in topic.rows(topic.vector(*names)):
        yield LoggedSample(time_us, kind(time_us, vector(row), vector(row[3:])))


def _attitude(topic: Topic) -> Iterator[LoggedSample]:
    for _, time_us, (w, x, y, z) in topic.rows(_quaternions(topic.vector("Roll", "Pitch", "Yaw"))):
        yield LoggedSample(time_us, messages.Attitude(time_us, (w, x, y, z)))


def _quaternions(angles_deg: Floats | None) -> Floats | None:
    """Body to NED, of roll, pitch and yaw."""
    if angles_deg is None:
        return None
    return np.array([QuaternionBase(row).q for row in np.radians(angles_deg)]).reshape(-1, 4)  # of no sample, too


def _attitude_targets(throttle: Topic, attitude: Topic) -> Iterator[LoggedSample]:
    """With the throttle as it was last told: the attitude is logged oftener."""
    thrust, asked = throttle.column("ThO"), _quaternions(attitude.vector("DesRoll", "DesPitch", "DesYaw"))
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


def _heartbeats(events: Topic, modes: Topic) -> Iterator[LoggedSample]:
    """One at every change of the mode and of what is armed; a log that tells of no arming is of a flight."""
    arming = [(t, int(event)) for _, t, (event,) in events.rows(events.vector("Id")) if event in (_ARMED, _DISARMED)]
    armed, mode = not arming or arming[0][1] == _DISARMED, 0
    news: list[tuple[int, int | None, int]] = [
        (time_us, None, int(number)) for _, time_us, (number,) in modes.rows(modes.vector("ModeNum"))
    ]
    news += [(time_us, event, 0) for time_us, event in arming]
    for time_us, event, number in sorted(news, key=lambda item: item[0]):
        if event is None:
            mode = _MODES.get(mode_mapping_acm.get(number, ""), 0)
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


def _demand(topic: Topic) -> Iterator[LoggedSample]:
    """The climb rate that pilot or mission ask for."""
    for _, time_us, (speed_down_m_s,) in topic.rows(topic.vector("DVD")):
        yield LoggedSample(time_us, messages.PositionTarget(None, speed_down_m_s))
