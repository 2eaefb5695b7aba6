"""The second autopilot: what a flight says to ArduPilot's Copter, what it understands of it, and whom it refuses."""

import itertools
import math
import struct
import sys
from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import ardupilotmega
from pymavlink.dialects.v20 import development as mav

from bench.fly.virtual_time import EPOCH_US
from companion import messages
from companion.autopilot.ardupilot import modes, setup
from companion.autopilot.ardupilot.firmware import ARDUPILOT
from companion.autopilot.interface import Pilot
from companion.autopilot.known import MODE_NAMES
from companion.autopilot.setup import SerialLine, Verdict
from companion.autopilot.setup import Setup as VehicleSetup
from companion.guard.config import GuardConfig
from companion.guard.guard import AttachedGuard, Guard
from companion.link.vehicle import Identity, Vehicle
from companion.mavlink.decode import Decoder
from companion.mavlink.encode import Encoder
from companion.mavlink.moves import would_move
from companion.messages import AttitudeSetpoint, AttitudeTarget, Parameter, PositionSetpoint, Refused, SendCommand
from companion.reflex.config import EstimateConfig
from rebound_cli.live.console import Console
from rebound_cli.preflight.command import show
from tests.companion.autopilot.fake_copter import ARM, AUX_FUNCTION, COPTER_LAND, GUIDED, SET_MODE, TAKE_OFF, FakeCopter
from tests.companion.fake_vehicle import INTO_WALL, LANDING, SQUARE_ITEMS, TAKEOFF, FakeVehicle, flight
from tests.flying import Flight


def commanded(f, number):
    return [(t, message) for t, message in f.vehicle.commands if message.command == number]


# --- a flight


def test_it_is_told_to_take_off_and_hears_no_setpoint_until_it_is_up():
    f = flight(FakeCopter(), items=SQUARE_ITEMS)
    f.run_until(lambda: commanded(f, TAKE_OFF))
    ((told_us, message),) = commanded(f, TAKE_OFF)
    assert message.param7 == 1.5
    f.run_until(lambda: f.vehicle.position[2] < -1.4)
    assert [t for t, _ in f.vehicle.setpoints if t > told_us] == []
    assert f.run_to_end().outcome == "completed"
    assert f.vehicle.setpoints[-1][0] > told_us
    # And it is flown in GUIDED and landed in LAND, which the fake has translated
    assert [int(message.param2) for _, message in commanded(f, SET_MODE)] == [6, 4]
    modes_seen = [event.data["custom_mode"] for event in f.events if event.kind == "mode"]
    assert modes_seen[-2:] == [GUIDED, COPTER_LAND]


@pytest.mark.parametrize(("vehicle", "may_be_whole"), [(FakeVehicle, True), (FakeCopter, False)])
def test_no_hit_that_is_seen_through_a_filter_counts_as_measured_whole(vehicle, may_be_whole):
    f = flight(vehicle(wall_north_m=3.0), items=[TAKEOFF, INTO_WALL, LANDING])
    f.run_until(lambda: any(event.kind == "detection" for event in f.events))
    reflex = f.companion.core.reflex
    assert reflex.monitor.estimator.contact.is_clipped is not may_be_whole
    # And no model of PX4's estimator says when the vehicle's own velocity is right again
    assert reflex.hits[-1].estimator.fits_models is may_be_whole
    # Its integrators begin with the tilt that was asked for last, PX4's with none
    assert reflex.newest.rests_s == (0.1 if may_be_whole else 0.5)


# --- by attitude


def leaning(vehicle):
    """A flight that recovers from a hit by attitude: the scripted vehicles tell nothing of their thrust."""
    f = flight(vehicle, items=[TAKEOFF, INTO_WALL, LANDING])
    f.run_to("mission")
    assert f.companion.last_words() == [], "none is left before a hit"
    thrust = f.companion.core.reflex.monitor.state.thrust
    thrust.known_s, thrust.full_m_s2 = 1.0, 20.0
    f.run_to("recovering")
    f.run_for(0.1)
    return f


def test_force_flying_is_high_only_while_it_is_flown_by_attitude():
    f = leaning(FakeCopter(wall_north_m=3.0))
    f.companion.stop("Ctrl-C, and once more")
    f.run_to_end()
    forced = [(message.param1, message.param2) for _, message in commanded(f, AUX_FUNCTION)]
    assert [high for high, _ in itertools.groupby(forced)] == [(159, 0), (159, 2), (159, 0)]


def test_a_pilot_of_a_copter_that_is_critical_has_it_at_once():
    f = flight(FakeCopter(), items=[TAKEOFF, INTO_WALL, LANDING])
    f.run_to("mission")
    f.vehicle.failsafe = True
    f.run_for(1.5)
    f.vehicle.mode, chosen_us = 2, f.now_us  # ALT_HOLD
    f.run_to("aborted", 0.4)
    assert f.setpoints_since(chosen_us + 250_000) == []


def test_the_last_words_of_a_companion_are_a_lean_and_a_place_off_what_was_hit():
    f = leaning(FakeCopter(wall_north_m=3.0))
    *leans, (place_s, place) = f.companion.last_words()
    # Copter's velocity is wrong for 0.8 s, of which 0.1 s have passed, and leaning takes 0.15 s. Until then a lean is
    # said twice within the 0.3 s for which it is flown on
    assert place_s == pytest.approx(0.85, abs=0.03)
    assert [lean_s for lean_s, _ in leans] == pytest.approx([0.0, 0.15, 0.3, 0.45, 0.6, 0.75])
    assert len({lean for _, lean in leans}) == 1
    sent = mav.MAVLink(None).decode(bytearray(leans[0][1]))
    assert sent.get_type() == "SET_ATTITUDE_TARGET"
    w, x, y, z = sent.q
    assert math.degrees(math.asin(2.0 * (w * y - z * x))) == pytest.approx(8.7, abs=1.0)  # 1.5 m/s^2 to the south
    sent = mav.MAVLink(None).decode(bytearray(place))
    assert sent.get_type() == "SET_POSITION_TARGET_LOCAL_NED" and sent.type_mask & 0x1FF == 0x1F8
    # Its wrong tilt moves it by 2 m before it turns
    assert f.vehicle.position[0] - sent.x == pytest.approx(4.0, abs=0.3)
    # A Copter that holds an attitude for no time, GUID_TIMEOUT 0, is told one as often as a setpoint is sent
    f.companion.core.reflex.loss_s = 0.0
    first, second, *_ = f.companion.last_words()
    assert second[0] - first[0] == pytest.approx(0.02)
    # Where it leans by 35 degrees, the thrust is gravity's, of 20 m/s^2 at most: what carries it at 35 degrees would
    # lift it by 2 m/s^2
    flown = f.companion.core.flight.target
    leans = replace(flown.lean, belief=replace(flown.lean.belief, attitude_wxyz=(0.954, 0.0, 0.301, 0.0)))
    f.companion.core._sent = replace(flown, lean=leans)
    (_, lean), *_ = f.companion.last_words()
    assert mav.MAVLink(None).decode(bytearray(lean)).thrust == pytest.approx(9.81 / 20.0, abs=0.01)
    # And none is left where the next setpoint is a place: the hit was taken back while the mode is not known
    f.companion.core._sent = flown.at_rest()
    assert f.companion.last_words() == []


def test_the_place_of_the_last_words_is_the_one_that_was_sent():
    # Given a PX4 whose own place a hit has left wrong by a metre
    f = leaning(FakeVehicle(wall_north_m=3.0, loss_s=0.3))
    core, hit = f.companion.core, f.companion.core.reflex.newest
    hit.estimator.has_converged, hit.estimator.position_error_m, hit.leans = True, (0.0, 1.0, 0.0), False
    core._stream_setpoint(True, f.now_us)
    (_, word), *_ = f.companion.last_words()
    (sent,) = [each for each in core.flight.outbox if isinstance(each, PositionSetpoint)]
    word = mav.MAVLink(None).decode(bytearray(word))
    assert word.y == pytest.approx(sent.position_ned_m[1]) and word.y > core.flight.target.position_ned_m[1] + 0.9


def test_to_a_px4_the_last_words_are_a_lean_that_brakes_until_its_own_velocity_is_right():
    # Given a PX4 that leaves the wall at 4 m/s when its companion dies, 0.1 s after the hit
    f = leaning(FakeVehicle(wall_north_m=3.0, loss_s=0.3))
    flown = f.companion.core.flight.target
    moves = replace(flown.lean.belief, velocity_ned_m_s=(-4.0, 0.0, 0.0), spread_m_s=0.1, level_m_s2=(0.0, 0.0, 0.0))
    f.companion.core._sent = replace(flown, lean=replace(flown.lean, belief=moves))
    leans = f.companion.last_words()
    # Then it is held until 1.4 s after the hit, the last 0.43 s of it by PX4 itself. It ends what is certain of the
    # speed, but for 1.5 m/s^2 by which the tilt may be wrong
    assert leans[-1][0] == pytest.approx(0.75)
    assert {mav.MAVLink(None).decode(bytearray(lean)).get_type() for _, lean in leans} == {"SET_ATTITUDE_TARGET"}
    w, x, y, z = mav.MAVLink(None).decode(bytearray(leans[0][1])).q
    tilt_deg = math.degrees(math.asin(2.0 * (w * y - z * x)))
    assert tilt_deg == pytest.approx(math.degrees(math.atan((1.5 - 3.9 / 1.3) / 9.81)), abs=0.5)


@pytest.mark.parametrize(
    ("vehicle", "later_s", "said_s"),
    [
        (lambda: FakeCopter(wall_north_m=3.0), 1.0, [0.0, 0.15]),  # the place is said soon
        (lambda: FakeVehicle(wall_north_m=3.0, loss_s=0.3), 1.0, []),  # a PX4 flies well by itself
        (lambda: FakeVehicle(wall_north_m=3.0, loss_s=1.0), 0.0, [0.0, 0.5, 1.0]),  # by position: the place again
    ],
)
def test_words_are_left_until_a_vehicle_flies_well_by_itself(vehicle, later_s, said_s):
    f = leaning(vehicle())
    f.companion.core.reflex.hits[-1].estimator.hit_boot_us -= round(1e6 * later_s)
    assert [at_s for at_s, _ in f.companion.last_words()] == pytest.approx(said_s)


def test_a_word_that_is_not_sent_counts_for_no_packet():
    encoder, place = Encoder(), PositionSetpoint(0, (1.0, 2.0, -3.0), None)
    assert encoder.unsent(place) == encoder.packets(place)[0]


@pytest.mark.parametrize(
    ("timeout_s", "options", "held_s"), [(0.3, 8.0, 0.3), (3.0, 12.0, 3.0), (0.3, 0.0, math.inf), (0.3, 4.0, math.inf)]
)
def test_an_attitude_is_asked_for_only_where_its_thrust_is_thrust(timeout_s, options, held_s):
    f = flight(FakeCopter(parameters={"GUID_TIMEOUT": timeout_s, "GUID_OPTIONS": options}))
    f.run_to("mission")
    assert f.companion.core.flight.reflex.loss_s == pytest.approx(held_s)


def test_an_attitude_has_all_three_rates():
    message = sent(AttitudeSetpoint(0, (1.0, 0.0, 0.0, 0.0), 0.4, 0.1))
    assert message.type_mask == 0 and message.thrust == pytest.approx(0.4)
    rates = (message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate)
    assert rates == pytest.approx((0.0, 0.0, 0.1))


# --- on the wire


def sent(outgoing):
    encoder = Encoder()
    encoder.speak_to(1, 1, ARDUPILOT)
    (packet,) = encoder.packets(outgoing)
    return mav.MAVLink(None).decode(bytearray(packet))


def heard(*messages):
    """What the last of them is heard as."""
    decoder = Decoder()
    decoder.listen_to(1, 1, ARDUPILOT)
    link = ardupilotmega.MAVLink(None, 1, 1)
    return [sample for message in messages for _, sample in decoder.feed(bytes(message.pack(link)))][-1]


@pytest.mark.parametrize("kind", [mav.MAV_PARAM_TYPE_INT8, mav.MAV_PARAM_TYPE_INT16, mav.MAV_PARAM_TYPE_INT32])
def test_a_whole_number_travels_as_a_float_both_ways(kind):
    assert heard(mav.MAVLink_param_value_message(b"GUID_OPTIONS", 12.0, kind, 1, 0)) == Parameter("GUID_OPTIONS", 12)
    message = sent(Parameter("GUID_OPTIONS", 12))
    assert (message.param_value, message.param_type) == (12.0, mav.MAV_PARAM_TYPE_REAL32)
    assert heard(mav.MAVLink_param_value_message(b"GUID_OPTIONS", math.nan, kind, 1, 0)) is None


def test_the_estimators_report_is_its_own_message():
    told = ardupilotmega.MAVLink_ekf_status_report_message
    assert heard(told(0x33F, 0.1, 0.2, 0.3, 0.4, 0.0)) == messages.EstimatorStatus(
        tuple(struct.unpack("<3f", struct.pack("<3f", 0.1, 0.2, 0.3))), True, False
    )
    assert heard(told(0, 0.1, 0.2, 0.3, 0.4, 0.0)).horizontal_velocity_is_good is False
    assert isinstance(heard(told(0, math.nan, 0.2, 0.3, 0.4, 0.0)), Refused)


@pytest.mark.parametrize(("thrust", "heard_as"), [(-0.05, 0.0), (0.5, 0.5)])
def test_a_thrust_below_none_is_none(thrust, heard_as):
    message = mav.MAVLink_attitude_target_message(1, 0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, thrust)
    assert heard(message) == AttitudeTarget(1000, heard_as, (1.0, 0.0, 0.0, 0.0))
    message.thrust = math.nan
    assert isinstance(heard(message), Refused)


def test_modes_have_copters_names_and_numbers():
    copter_modes = ardupilotmega.enums["COPTER_MODE"]
    theirs = {entry.name.removeprefix("COPTER_MODE_"): number for number, entry in copter_modes.items()}
    assert {number: mode.name for number, mode in modes.MODES.items()}.items() <= {
        (number, name) for name, number in theirs.items()
    }
    assert ARDUPILOT.mode(99).name == "mode 99" and ARDUPILOT.mode(99).pilot is None
    flown_by = {name: ARDUPILOT.mode(theirs[name]).pilot for name in ("STABILIZE", "AUTO", "LOITER", "GUIDED")}
    assert [*flown_by.values()] == [Pilot.HAND, Pilot.AUTOPILOT, Pilot.STICKS, Pilot.SETPOINTS]


# --- whom it refuses


def refuses(number):
    return FakeCopter(
        ack=lambda command, count: [4 if command == number else 0], obey=lambda command, count: command != number
    )


OLD = 4 << 24 | 2 << 16 | 3 << 8
TOO_OLD = "ArduPilot 4.2.3 is too old: ArduPilot 4.3 is the oldest that flies"


@pytest.mark.parametrize(
    ("vehicle", "words"),
    [
        (FakeCopter(vehicle_type=1), ["the vehicle is not a multicopter (MAV_TYPE 1)"]),
        (FakeCopter(flight_version=OLD), [TOO_OLD]),
        (FakeCopter(no_positions=True), ["no position: LOCAL_POSITION_NED"]),
        (refuses(ARM), ["not armed: arm: the vehicle answered FAILED"]),
        (refuses(TAKE_OFF), ["no take-off: take-off to 1.5 m: the vehicle answered FAILED"]),
    ],
    ids=lambda given: given[0][-30:] if isinstance(given, list) else "",
)
def test_what_cannot_be_flown_ends_the_flight_in_one_sentence(vehicle, words):
    report = flight(vehicle).run_to_end()
    assert report.outcome != "completed" and all(word in report.reason for word in words), report.reason


def guarded(vehicle):
    """A guard that stands by, on a link with the vehicle."""
    f = Flight(Guard(GuardConfig()), vehicle)
    f.run_to("standing by", 30.0)
    return f


def test_a_guard_meets_a_copter_and_hears_its_sticks_as_pulses():
    vehicle = FakeCopter()
    guarded(vehicle)
    streams = {int(message.param1) for _, message in vehicle.commands if message.command == 511}
    assert {65, 85} <= streams and 69 not in streams
    assert {"LOITER", "AUTO", "POSHOLD", "GUIDED"} <= MODE_NAMES
    assert not {"STABILIZE", "ACRO", "LAND"} & set(GuardConfig().modes)
    # What a dead companion has left high is set low
    assert [message.param2 for _, message in vehicle.commands if message.command == AUX_FUNCTION] == [0.0]


def test_a_switch_that_is_not_answered_is_set_again():
    vehicle = FakeCopter(ack=lambda command, count: [] if command == AUX_FUNCTION and count < 3 else [0])
    guarded(vehicle).run_for(2.0)
    switched = [message.confirmation for _, message in vehicle.commands if message.command == AUX_FUNCTION]
    assert switched == [0, 1, 2]


@pytest.mark.parametrize("current", [0, 2, 3])
def test_a_place_that_dronekit_sends_is_kept_out_while_a_guard_recovers(current):
    fields = (1, 1, 0, 3, 16, current, 0, 0, 0, 0, 0)
    item = mav.MAVLink_mission_item_message(*fields, 1.0, 2.0, 3.0)
    assert would_move(bytes(item.pack(mav.MAVLink(None, 255, 0))), ARDUPILOT) is (current != 0)


def test_a_radios_pulses_are_the_pilots_sticks():
    pulses = (1600, 1300, 1000, 1500, *(0,) * 14)
    message = mav.MAVLink_rc_channels_message(0, 8, *pulses, 255)
    assert heard(message).deflections == pytest.approx((0.4, 0.2, -1.0, 0.0))
    assert heard(mav.MAVLink_rc_channels_message(0, 0, *(0xFFFF,) * 18, 255)) is None


@pytest.mark.parametrize("asked", [(27, 1_000_000), (None, 0)])
def test_a_board_without_highres_imu_is_asked_for_its_raw_one_and_a_client_that_slows_it_down_is_noticed(asked):
    vehicle = FakeCopter(ack=lambda command, count: [2] if command == 511 and count == 1 else [0])  # first the IMU's
    guard = guarded(vehicle).companion
    intervals_us = [(int(sent.param1), sent.param2) for _, sent in vehicle.commands if sent.command == 511]
    assert intervals_us[:2] == [(105, intervals_us[0][1]), (27, intervals_us[0][1])]
    guard.hear_interval(*asked)
    again = [sent.command.parameters[0] for sent in guard.core.flight.outbox if isinstance(sent, SendCommand)]
    assert again == [27] if asked[0] else {27, 65} <= {*again}


def test_a_raw_imu_has_milli_units_and_counts_until_the_finer_one_comes():
    raw = ardupilotmega.MAVLink_raw_imu_message(4000, 102, 0, -1000, 100, 0, -50, 0, 0, 0)
    finer = ardupilotmega.MAVLink_highres_imu_message(8000, 1.0, 0.0, -9.8, *(0.0,) * 10, 7)
    assert heard(raw).specific_force_frd_m_s2 == pytest.approx((1.0, 0.0, -9.80665), abs=1e-3)
    assert heard(raw).angular_velocity_frd_rad_s == pytest.approx((0.1, 0.0, -0.05))
    assert heard(raw, finer).specific_force_frd_m_s2 == pytest.approx((1.0, 0.0, -9.8))
    assert heard(raw, finer, raw) is None


def test_a_guard_inside_a_program_refuses_it():
    guard, heartbeat = AttachedGuard(GuardConfig(), 1), mav.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3)
    guard.step(heartbeat.pack(mav.MAVLink(None, 1, 1)), EPOCH_US)
    guard.step(b"", guard.next_deadline_us())
    assert "PX4 alone" in guard.core.flight.reason and guard.core.handler.finished


# --- preflight


def test_preflight_says_what_it_has_met(capsys):
    met = Vehicle(identity=Identity(1, 1, "quadrotor", ARDUPILOT), autopilot=ARDUPILOT)
    show(Console(sys.stdout), met, [])
    assert "ArduPilot, quadrotor" in capsys.readouterr().out


HEALTHY = {"GUID_TIMEOUT": 0.3, "GUID_OPTIONS": 8, "INS_ACCEL_FILTER": 20, "FENCE_ENABLE": 0, "FRAME_CLASS": 1}
HEALTHY |= {
    "FS_CRASH_CHECK": 1,
    "ATC_RATE_FF_ENAB": 0,
    "ATC_RAT_YAW_PDMX": 0.3,
    "PSC_NE_JERK": 5,
    "ATC_ANGLE_MAX": 30,
    "ARMING_SKIPCHK": 0,
}
UART = SerialLine(921_600)
ON_SERIAL2 = {"SERIAL2_PROTOCOL": 2, "SERIAL2_BAUD": 921}


def setup_of(parameters, line=None):
    return VehicleSetup(parameters, line, "quadrotor", EstimateConfig(), 250.0, 5.7, "")


def judged(parameters, line=None):
    told = setup_of(parameters, line)
    return {item.item: item for item in (*setup.frame(told), *setup.port(told), *setup.judge_parameters(told))}


def test_a_healthy_copter_has_nothing_to_mend():
    found = judged({**HEALTHY, **ON_SERIAL2}, UART)
    assert {item.verdict for item in found.values()} == {Verdict.GOOD}
    assert set(found) == {*HEALTHY, "port"}


@pytest.mark.parametrize(
    ("changed", "line", "item", "remedy"),
    [
        ({"GUID_TIMEOUT": 3.0}, None, "GUID_TIMEOUT", "GUID_TIMEOUT = 0.3"),
        ({"GUID_OPTIONS": 4}, None, "GUID_OPTIONS", "GUID_OPTIONS = 12"),
        ({"INS_ACCEL_FILTER": 10}, None, "INS_ACCEL_FILTER", "INS_ACCEL_FILTER = 20"),
        ({"INS_ACCEL_FILTER": 0}, None, "INS_ACCEL_FILTER", "INS_ACCEL_FILTER = 20"),
        ({"FENCE_ENABLE": 1}, None, "FENCE_ENABLE", "FENCE_ENABLE = 0"),
        ({"FS_CRASH_CHECK": 0}, None, "FS_CRASH_CHECK", "FS_CRASH_CHECK = 1"),
        ({"ATC_RATE_FF_ENAB": 1}, None, "ATC_RATE_FF_ENAB", "ATC_RATE_FF_ENAB = 0"),
        ({"ATC_RAT_YAW_PDMX": 0.0}, None, "ATC_RAT_YAW_PDMX", "ATC_RAT_YAW_PDMX = 0.3"),
        ({"ATC_RAT_YAW_PDMX": 0.5}, None, "ATC_RAT_YAW_PDMX", "ATC_RAT_YAW_PDMX = 0.3"),
        ({"PSC_NE_JERK": 2}, None, "PSC_NE_JERK", "PSC_NE_JERK = 5"),
        ({"ATC_ANGLE_MAX": 10}, None, "ATC_ANGLE_MAX", "ATC_ANGLE_MAX = 30"),
        ({"ARMING_SKIPCHK": 8}, None, "ARMING_SKIPCHK", "ARMING_SKIPCHK = 0"),
        ({"FRAME_CLASS": 2}, None, "FRAME_CLASS", "Mission Planner"),
        ({"SERIAL2_BAUD": 57}, UART, "port", "SERIAL2_PROTOCOL = 2"),
        ({"SERIAL2_BAUD": 57}, SerialLine(57_600), "port", "SERIAL2_BAUD = 921"),
        ({"SERIAL2_PROTOCOL": 1}, UART, "SERIAL2_PROTOCOL", "SERIAL2_PROTOCOL = 2, then reboot"),
    ],
)
def test_what_is_not_as_it_should_be_has_its_remedy(changed, line, item, remedy):
    found = judged({**HEALTHY, **ON_SERIAL2, **changed}, line)
    assert found[item].verdict is not Verdict.GOOD and remedy in found[item].remedy


def test_older_firmware_has_other_names_and_hundredths_of_a_degree():
    older = {"PSC_JERK_XY": 5, "ANGLE_MAX": 1000, "ARMING_CHECK": 0}
    newer = {"PSC_NE_JERK", "ATC_ANGLE_MAX", "ARMING_SKIPCHK"}
    found = judged({**{name: value for name, value in HEALTHY.items() if name not in newer}, **older})
    assert found["PSC_JERK_XY"].verdict is Verdict.GOOD
    assert "10 degrees" in found["ANGLE_MAX"].found and found["ANGLE_MAX"].remedy == "ANGLE_MAX = 3000"
    assert found["ARMING_CHECK"].remedy.startswith("ARMING_CHECK = 1")


def test_what_was_not_told_is_doubtful_and_what_is_asked_is_judged():
    found = judged({})
    assert {item.verdict for item in found.values()} == {Verdict.DOUBTFUL}
    older = {"PSC_JERK_NE", "PSC_JERK_XY", "ANGLE_MAX", "ARMING_CHECK"}
    assert {*setup.PARAMETERS} == {*HEALTHY, *setup.OF_A_LINE} | older and {*ON_SERIAL2} <= {*setup.OF_A_LINE}


def test_the_slowest_hit_that_shows_follows_from_the_filter():
    # A jump of 1 m/s is a pulse of 2.86 m/s² for each Hz; a filter that was not told is the default
    for told, found in (({setup.FILTER: 40}, "0.05 m/s on through a filter of 40 Hz"), ({}, "0.10 m/s")):
        assert found in setup.sight(setup_of(told)).found
