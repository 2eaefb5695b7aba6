"""ArduPilot's logs as PX4's link would have carried them, and what is refused.

They are small, written byte by byte as libraries/AP_Logger/README.md of ArduPilot describes them. Every message is two
bytes of head, its type and its fields without gaps. What a type's fields are is told by a message of type 128, FMT: the
type described, its length, a name of four bytes, sixteen letters and sixty-four bytes of names.
"""

import math
import struct

import pytest
from scipy.signal import butter, lfilter

from companion import messages
from companion.autopilot.px4.firmware import PX4
from companion.messages import Attitude, ExtendedState, Heartbeat, ImuSample, LandedState, PositionTarget
from companion.motion.rotation import body_to_ned
from rebound_cli.logs.log import LogError
from rebound_cli.logs.reader import read_log
from tests.rebound_cli.logs.test_ulog import of

HEAD = b"\xa3\x95"
# A letter of FMT to that of struct, and the factor by which a number is kept.
LETTERS = {"B": ("B", 1), "b": ("b", 1), "H": ("H", 1), "h": ("h", 1), "I": ("I", 1), "Q": ("Q", 1), "f": ("f", 1)}
LETTERS |= {"M": ("B", 1), "c": ("h", 100), "C": ("H", 100), "L": ("i", 10_000_000), "N": ("16s", 1), "Z": ("64s", 1)}
FORMAT = ("BBnNZ", "Type,Length,Name,Format,Columns")


# Copter 4.3: an instance in I, a core in C.
FORMATS = {
    "MSG": ("QZ", "TimeUS,Message"),
    "PARM": ("QNff", "TimeUS,Name,Value,Default"),
    "IMU": ("QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "ATT": ("Qccccff", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw"),
    "CTUN": ("Qffhh", "TimeUS,ThO,Alt,DCRt,CRt"),
    "XKF1": ("QBccCffffff", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,PN,PE,PD"),
    "XKF4": ("QBIb", "TimeUS,C,SS,PI"),
    "EV": ("QB", "TimeUS,Id"),
    "MODE": ("QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "PSCD": ("Qfff", "TimeUS,TPD,DVD,TVD"),
}


def structure(letters):
    return struct.Struct("<" + "".join(LETTERS[letter][0] for letter in letters))


def described(number, name, letters, columns):
    length = 89 if name == "FMT" else 3 + structure(letters).size
    fields = struct.pack("<BB4s16s64s", number, length, name.encode(), letters.encode(), columns.encode())
    return HEAD + bytes([128]) + fields


def packed(number, letters, row):
    values = [
        value.encode() if isinstance(value, str) else round(value * factor) if code not in "fsd" else value
        for value, (code, factor) in zip(row, (LETTERS[letter] for letter in letters), strict=True)
    ]
    return HEAD + bytes([number]) + structure(letters).pack(*values)


def dataflash(rows, formats=FORMATS):
    """Rows: (name, value, ...), as they were written. Formats: name -> (letters, columns)."""
    numbers = {name: 129 + number for number, name in enumerate(formats)}
    parts = [described(128, "FMT", *FORMAT)]
    parts += [described(numbers[name], name, *described_by) for name, described_by in formats.items()]
    parts += [packed(numbers[name], formats[name][0], row) for name, *row in rows]
    return b"".join(parts)


def imu(times_us, force=(0.0, 0.0, -9.81), instance=0):
    return [("IMU", t, instance, 0.1, 0.2, 0.3, *force) for t in times_us]


COPTER = ("MSG", 0, "ArduCopter V4.5.7 (2a3dc4b7)")
IMU = imu([1_000_000, 1_020_000])


def read(tmp_path, rows, formats=FORMATS, name="flight.BIN"):
    path = tmp_path / name
    path.write_bytes(dataflash(rows, formats))
    return read_log(path)


@pytest.mark.parametrize("name", ["flight.BIN", "flight"])
def test_the_imu_at_rest(tmp_path, name):
    log = read(tmp_path, [COPTER, *IMU], name=name)
    # Then a vehicle at rest is held up: its specific force is -9.81 m/s^2 on the axis that points down
    first, second = of(log, ImuSample)
    assert (first.time_boot_us, second.time_boot_us) == (1_000_000, 1_020_000)
    assert first.specific_force_frd_m_s2 == pytest.approx((0.0, 0.0, -9.81), abs=1e-6)
    assert first.angular_velocity_frd_rad_s == pytest.approx((0.1, 0.2, 0.3), abs=1e-6)
    assert log.started_at_us == 1_000_000


def test_a_sample_holds_what_its_low_pass_filter_has_not_forgotten(tmp_path):
    # Given the filter's cut-off among the parameters
    log = read(tmp_path, [COPTER, ("PARM", 0, "INS_ACCEL_FILTER", 20.0, 20.0), *IMU])
    # When a short contact goes through such a filter
    rate_hz = 10_000
    answer = lfilter(*butter(2, 20.0, fs=rate_hz), [1.0, *[0.0] * (rate_hz // 5)])
    # Then the window ends where the pulse is first back at nothing, and what comes after it is below a twentieth
    window = round(log.window_us * 1e-6 * rate_hz)
    assert (answer[: window - 2] > 0.0).all() and (answer[window + 2 : 2 * window] < 0.0).all()
    assert abs(answer[window:]).max() < 0.05 * answer.max()
    assert log.averaging_us is None


@pytest.mark.parametrize("told", [0.0, -5.0, math.nan])
def test_what_no_parameter_tells_is_the_default_filter(tmp_path, told):
    rows = [COPTER, *[("PARM", 0, name, told, 0) for name in ("INS_ACCEL_FILTER", "FRAME_CLASS")], *IMU]
    assert read(tmp_path, rows).low_pass_hz == 20.0


@pytest.mark.parametrize(
    ("told", "axis", "points"),
    [
        # Rolled to the right with the nose east: the body's down is half way to the left, which is north
        (("ATT", 1_005_000, 0.0, 30.0, 0.0, 0.0, 90.0, 90.0), (0.0, 0.0, 1.0), (0.5, 0.0, math.sqrt(0.75))),
        # A nose that is up points up
        (("ATT", 1_005_000, 0.0, 0.0, 0.0, 30.0, 0.0, 0.0), (1.0, 0.0, 0.0), (math.sqrt(0.75), 0.0, -0.5)),
        # Without ATT the estimator tells it: a nose that is east points east
        (("XKF1", 1_000_000, 0, 0.0, 0.0, 90.0, *[0.0] * 6), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ],
)
def test_attitude_turns_the_body_as_it_should(tmp_path, told, axis, points):
    (attitude,) = of(read(tmp_path, [COPTER, *IMU, told]), Attitude)
    assert body_to_ned(attitude.attitude_wxyz, axis) == pytest.approx(points, abs=1e-6)


def test_thrust_is_told_with_the_attitude_that_is_asked_for(tmp_path):
    rows = [COPTER, *IMU, ("CTUN", 1_000_000, 0.4, 0.0, 0, 0), ("ATT", 1_005_000, 10.0, *[0.0] * 5)]
    (target,) = of(read(tmp_path, rows), messages.AttitudeTarget)
    assert target.time_boot_us == 1_005_000
    assert target.thrust_fraction == pytest.approx(0.4)
    assert body_to_ned(target.attitude_wxyz, (0.0, 1.0, 0.0))[2] == pytest.approx(math.sin(math.radians(10.0)))


def test_the_estimate_is_of_the_core_that_flies(tmp_path):
    # Given two cores, of which the second becomes the primary one between two estimates
    rows = [COPTER, *IMU]
    for time_us, primary in ((1_000_000, 0), (1_010_000, 1)):
        rows.append(("XKF4", time_us, 0, 0xFF, primary))
        rows += [
            ("XKF1", time_us + 10, core, 0.0, 0.0, 0.0, 1.0 + core, 2.0, 3.0, 4.0, 5.0, -6.0 - core) for core in (0, 1)
        ]
    first, second = of(read(tmp_path, rows), messages.LocalPosition)
    assert (first.velocity_ned_m_s, first.position_ned_m) == ((1.0, 2.0, 3.0), (4.0, 5.0, -6.0))
    assert (second.velocity_ned_m_s, second.position_ned_m) == ((2.0, 2.0, 3.0), (4.0, 5.0, -7.0))


def test_a_number_that_looks_like_a_message_is_none(tmp_path):
    (odd,) = struct.unpack("<f", HEAD + b"\x80\x02")
    assert len(of(read(tmp_path, [COPTER, *IMU, ("PARM", 0, "ODD", odd, 0.0)]), ImuSample)) == len(IMU)


def test_events_arm_and_land(tmp_path):
    # Given a flight: armed 10, not landed 28, land complete 18, disarmed 11
    events = [("EV", 1_100_000 + 100_000 * number, event) for number, event in enumerate((10, 28, 18, 11))]
    log = read(tmp_path, [COPTER, *IMU, *events])
    states = [(h.at_us, h.sample.landed_state) for h in log.heard if isinstance(h.sample, ExtendedState)]
    assert states == [
        (1_000_000, LandedState.ON_GROUND),
        (1_100_000, LandedState.ON_GROUND),
        (1_200_000, LandedState.IN_AIR),
        (1_300_000, LandedState.ON_GROUND),
        (1_400_000, LandedState.ON_GROUND),
    ]
    assert [beat.armed for beat in of(log, Heartbeat)] == [True, False]
    # One that begins in the air first tells of the landing
    log = read(tmp_path, [COPTER, *IMU, ("EV", 1_100_000, 18), ("EV", 1_200_000, 11)])
    assert of(log, ExtendedState)[0].landed_state is LandedState.IN_AIR


def test_modes_are_those_of_px4_that_do_the_same(tmp_path):
    rows = [("MODE", 1_000_000 + number, number, number, 1) for number in (0, 16, 17)]
    beats = of(read(tmp_path, [COPTER, *IMU, *rows]), Heartbeat)
    assert [PX4.mode(beat.custom_mode).name for beat in beats] == ["STABILIZED", "POSCTL", "AUTO.LOITER"]


def test_the_climb_rate_the_samples_and_the_frame_are_those_of_the_first_sensor(tmp_path):
    rows = [("PSCD", 1_000_000, -3.0, 0.25, 9.0), *imu([1_000_000], force=(5.0, 0.0, 0.0), instance=1)]
    log = read(tmp_path, [COPTER, *IMU, *rows, ("PARM", 0, "FRAME_CLASS", 4.0, 0.0)])
    assert of(log, PositionTarget) == [PositionTarget(None, 0.25)]
    assert len(of(log, ImuSample)) == 2
    assert log.vehicle == "ArduCopter V4.5.7 (2a3dc4b7), octorotor"


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([("MSG", 0, "ArduPlane V4.5.7"), *IMU], "it is of ArduPlane V4.5.7"),
        ([("MSG", 0, "ArduCopter V4.2.3"), *IMU], "ArduCopter 4.3 and later"),
        ([COPTER, ("PARM", 0, "FRAME_CLASS", 6.0, 0.0), *IMU], "not a multicopter .MAV_TYPE 4."),
        (IMU, "does not say what vehicle"),
        ([COPTER], "no IMU samples"),
        ([COPTER, IMU[0]], "no IMU samples"),
    ],
)
def test_a_log_that_cannot_be_used_is_refused_in_a_sentence(tmp_path, rows, words):
    with pytest.raises(LogError, match=words) as refused:
        read(tmp_path, rows)
    assert "\n" not in str(refused.value)


def test_samples_without_times_are_refused(tmp_path):
    formats = FORMATS | {"IMU": ("ffffff", "GyrX,GyrY,GyrZ,AccX,AccY,AccZ")}
    with pytest.raises(LogError, match="no IMU samples with times"):
        read(tmp_path, [COPTER, *[("IMU", 0, 0, 0, 0, 0, -9.81)] * 5], formats)


def test_what_is_missing_is_said_with_its_cost(tmp_path):
    losses = read(tmp_path, [COPTER, *IMU]).losses
    assert any("no ATT" in loss and "direction of a hit" in loss for loss in losses)
    assert any("no CTUN" in loss and "thrust is not known" in loss for loss in losses)
    assert any("no EV" in loss and "arming" in loss for loss in losses)
    # So is a velocity that the estimator calls invalid
    rows = [COPTER, *IMU]
    for number in range(4):
        time_us = 1_000_000 + 50_000 * number
        rows += [("XKF1", time_us, 0, *[0.0] * 9), ("XKF4", time_us, 0, 0xFD if number else 0xFF, 0)]
        rows.append(("XKF4", time_us, 1, 0, 0))  # of a core that is not the primary one
    losses = read(tmp_path, rows).losses
    assert any("horizontal velocity is invalid" in loss and "75 %" in loss for loss in losses)
    assert not any("vertical velocity" in loss for loss in losses)
    # Of the primary core nothing is logged, and nothing is said
    losses = read(tmp_path, [COPTER, *IMU, ("XKF4", 1_000_000, 1, 0, 0)]).losses
    assert not any("own word" in loss for loss in losses)
