"""The guard as the link: whoever flies, by whatever message, is recovered, and nothing else is lost or changed."""

import math
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

import pytest
from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import development as dialect

from bench.fly import commanded
from bench.fly.commanded import ARM, FACE_NORTH_M, LAND, MANUAL_POSITION, OFFBOARD, by_places, fly_a_mission, sticks
from companion.autopilot.px4.firmware import PX4
from companion.guard.between import BURST_S, Between
from companion.guard.config import GuardConfig
from companion.guard.states import State
from companion.mavlink.moves import SETPOINT_IDS, would_move
from companion.mavlink.packet import message_id_of, packet_length
from companion.messages import Asked
from tests.guard.flying import BetweenFlight

TOO_LATE_S = 0.15
LINK_BYTES_S = 2_000_000
# A type mask.
ATTITUDE_ONLY = 0x07
MODES = (dialect.MAVLINK_MSG_ID_HEARTBEAT, dialect.MAVLINK_MSG_ID_CURRENT_MODE)


def by_attitudes(air: BetweenFlight) -> None:
    """Nose down by 3 degrees, the height held by the thrust."""
    hover = air.others_last["ATTITUDE_TARGET"].thrust
    nose_down = [math.cos(math.radians(1.5)), 0.0, -math.sin(math.radians(1.5)), 0.0]

    def attitude() -> None:
        position = air.others_last["LOCAL_POSITION_NED"]
        thrust = hover + 0.1 * (position.z + 2.5) + 0.1 * position.vz
        boot_ms = round(1e3 * air.time_s)
        air.send(dialect.MAVLink_set_attitude_target_message(boot_ms, 1, 1, ATTITUDE_ONLY, nose_down, 0, 0, 0, thrust))

    air.every(0.02, attitude)
    air.run_for(0.3)
    air.set_mode(OFFBOARD)


def hit(flies: Callable[[BetweenFlight], None], parameters: dict[str, float] | None = None, **changes) -> BetweenFlight:
    """Taken over at the wall."""
    air = BetweenFlight(GuardConfig(**changes), parameters)
    air.take_off()
    flies(air)
    air.run_until(lambda: air.guard.core.holds, 20.0)
    return air


@pytest.mark.parametrize("flies", [by_places, by_attitudes, fly_a_mission, commanded.by_sticks])
def test_whoever_flies_into_the_wall_is_recovered_and_nothing_of_his_moves_the_vehicle_meanwhile(flies):
    air = hit(flies)
    taken_s = air.time_s
    air.run_to(State.WATCHING, 10.0)
    back_s = air.time_s
    air.run_for(2.0)
    assert air.mode == "AUTO.LOITER" and len(air.told("detection")) == 1
    assert air.guard.status().position_ned_m[0] < FACE_NORTH_M - 0.3
    assert air.event("recovered").data["settled_after_s"] <= 4.0
    # Not one setpoint between the step that shows the hit and the step that gives it back
    assert air.sent_by("program", "SET_", taken_s + 0.001, back_s - 0.001) == []
    if flies in (by_places, by_attitudes):
        assert air.between.kept_out > 20
        assert len(air.sent_by("program", "SET_", back_s + 0.1, back_s + 1.1)) > 15, "let through again"
    # Its program sees it in OFFBOARD, and is told when it begins and when it ends
    heard = [message for at_s, message in air.heard if at_s >= taken_s - 0.01]
    told = [message.text for message in heard if message.get_type() == "STATUSTEXT"]
    assert any(text.startswith("Taking over") for text in told) and told[-1].startswith("Given back to AUTO.LOITER")


@pytest.mark.parametrize(
    ("flies", "loss_s", "late_s"),
    [(by_places, 1.0, 0.5), (by_places, 1.0, 1.3), (by_places, 0.3, 0.5), (fly_a_mission, 0.3, 0.5)],
)
def test_a_late_thread_lets_go_of_no_recovery(flies, loss_s, late_s):
    """PX4 leaves OFFBOARD meanwhile where it lasts for longer than COM_OF_LOSS_T, and flies to its own places."""
    # Given a recovery, and a computer that is busy with something else
    air = hit(flies, {"COM_OF_LOSS_T": loss_s})
    air.run_for(0.1)
    air.be_late(late_s)
    # When it has its turn again
    air.run_to(State.WATCHING, 10.0)
    # Then the recovery has gone on, and nobody is taken for another program
    assert [kind for kind in air.kinds() if kind in ("let_go", "refused", "left_alone")] == []
    assert air.told("recovered")[0].startswith("recovered: settled") and air.mode == "AUTO.LOITER"
    assert not air.guard.core.flight.program_elsewhere


@contextmanager
def silent(air: BetweenFlight) -> Iterator[None]:
    take, push = air.link.take, air.link.push
    air.link.take, air.link.push = lambda: (take(), ())[1], lambda packet: None
    yield
    air.link.take, air.link.push = take, push


@pytest.mark.parametrize(("loss_s", "silent_s"), [(0.3, 0.0), (1.0, 0.0), (0.3, 11.0)])
def test_after_a_restart_of_the_guard_in_flight_a_program_flies_when_it_asks_for_it_and_is_watched(loss_s, silent_s):
    # Given a recovery, and a guard that dies in it
    air = hit(by_places, {"COM_OF_LOSS_T": loss_s, "COM_OBL_RC_ACT": 5.0}, companion={"link": {"wait": True}})
    air.run_for(0.3)
    # When its service manager has begun another one, which hears nothing for a while
    with silent(air) if silent_s else nullcontext():
        air.be_restarted(1.0)
        air.run_for(silent_s)
    again_s = air.time_s
    air.run_to(State.STANDING_BY, 10.0)
    air.run_for(2.0)
    # Then PX4's failsafe holds the vehicle, and the program's setpoints do not end that
    assert air.sent_by("program", "SET_", again_s) == [] and len(air.vehicle.truth.hits) == 1
    assert air.told("not_back")[0].startswith("begun in flight")
    # Until it asks for OFFBOARD
    air.set_mode(OFFBOARD)
    air.run_until(lambda: air.mode == "OFFBOARD", 1.0)
    assert air.sent_by("program", "SET_", again_s) != [] and not air.between.has_chosen


def test_after_a_restart_in_flight_a_pilots_switch_chooses_and_an_onboard_computers_sticks_do_not():
    air = hit(by_places)
    air.be_restarted(1.0)
    air.run_to(State.STANDING_BY, 10.0)
    air.send(dialect.MAVLink_manual_control_message(1, 300, 0, 500, 0, 0), "computer", (1, 191))
    sticks(air, 0.0)
    air.run_for(0.5)
    assert air.between.awaits_choice
    # When the transmitter's switch, which is on no link of the guard's, asks for POSCTL, then for OFFBOARD
    for mode, name in ((MANUAL_POSITION, "POSCTL"), (OFFBOARD, "OFFBOARD")):
        switch = dialect.MAVLink_command_long_message(1, 1, 176, 0, 1, *mode, 0, 0, 0, 0)
        air.link.push(switch.pack(dialect.MAVLink(None, 254, 190)))
        air.run_until(lambda name=name: air.mode == name, 2.0)
        air.run_for(1.0)
    assert not air.between.awaits_choice


@pytest.mark.parametrize("lost", ["link", "requests"])
def test_a_vehicle_that_the_guard_has_let_go_of_is_flown_by_no_program_until_somebody_chooses(lost):
    # Given a recovery whose link is silent, or a pilot's stick and no mode that he is given
    air = hit(by_places)
    air.run_for(0.3)
    if lost == "link":
        with silent(air):
            air.run_for(1.8)
    else:
        pilot, push = sticks(air, 0.0), air.link.push
        air.run_for(0.3)
        air.link.push = lambda packet: None if message_id_of(packet) == 76 else push(packet)
        pilot()
        sticks(air, -0.6)
        air.run_for(1.0)
    # Then its setpoints lead to no second hit
    air.run_for(6.0)
    assert "the guard has released the vehicle" in air.told("not_back")[0] and len(air.vehicle.truth.hits) == 1


def test_a_reset_of_the_position_moves_what_the_guard_holds():
    jump = {"kind": "estimator_reset", "at_s": 15.7, "position_jump_ned_m": [-1.0, 0.0, 0.0]}
    air = BetweenFlight(GuardConfig(), faults=[jump])
    air.take_off()
    by_places(air)
    air.run_until(lambda: air.guard.core.holds, 20.0)
    assert 14.5 < air.time_s < 15.7, "the estimate jumps while the guard holds"
    hit_ned_m = air.guard.core.collisions()[0].position_ned_m
    air.run_for(8.0)
    assert any("reset by 1.00 m" in text for text in air.told("estimate")) and len(air.vehicle.truth.hits) == 1
    # What it says of the hit is in the vehicle's present frame
    assert air.guard.core.collisions()[0].position_ned_m[0] == pytest.approx(hit_ned_m[0] - 1.0, abs=0.01)
    # When the vehicle has landed, then its next start has a frame of its own
    air.set_mode(LAND)
    air.run_until(lambda: air.guard.core.flight.vehicle.armed is False, 20.0)
    air.run_for(0.1)
    assert air.guard.core.resets.shift_ned_m == (0.0, 0.0, 0.0)


def test_places_of_a_program_before_and_after_a_reset_of_the_position_have_no_velocity_between_them():
    air = hit(by_places)
    guard, there = air.guard, Asked((4.0, 0.0, -2.0))
    guard.hear_setpoint(there)
    air.run_for(0.04)
    guard.core.resets.shift_ned_m = (-0.05, 0.0, 0.0)
    guard.hear_setpoint(there)
    assert guard.core.flight.asked == Asked((4.05, 0.0, -2.0))


def test_a_program_that_steps_from_place_to_place_before_the_wall_is_left_alone():
    air = hit(by_places, then="previous")
    air.stop_all()
    north = [-3.0]
    air.every(commanded.REPEATED_EVERY_S, lambda: air.place(north[0]))
    air.run_to(State.WATCHING, 10.0)
    air.run_for(8.0)
    taken = len(air.told("take_over"))
    north[0] = 1.5
    air.run_for(6.0)
    assert len(air.told("take_over")) == taken


@pytest.mark.parametrize("is_armed", [False, True])
def test_a_guard_that_begins_on_the_ground_keeps_nothing_out(is_armed):
    air = BetweenFlight()
    air.run_to(State.STANDING_BY, 10.0)
    if is_armed:
        air.run_for(2.0)
        air.command(ARM, 1)
        air.run_for(0.5)
        air.be_restarted(0.5)
        air.run_to(State.STANDING_BY, 10.0)
    air.between.kept_out = 0
    air.velocity(1.0)
    air.run_for(0.1)
    assert air.between.kept_out == 0 and air.sent_by("program", "SET_", air.time_s - 0.11) != []


def test_a_failsafe_that_lasts_has_the_vehicle_also_in_a_recovery():
    # Given a recovery, and a battery that calls the vehicle home
    air, vehicle = hit(by_places), dialect.MAVLink(None, 1, 1)
    air.run_for(0.3)
    # When its reports say so, with OFFBOARD still intended
    told, heard = dialect.MAVLink_current_mode_message(0, 4 << 16 | 5 << 24, OFFBOARD[0] << 16), air.link.take
    air.link.take = lambda: (told.pack(vehicle), *(packet for packet in heard() if message_id_of(packet) not in MODES))
    # Then the guard waits as long as PX4 needs to go on by setpoints that were late, and releases the vehicle
    assert air.run_to(State.STOOD_DOWN, 1.0) == pytest.approx(0.4, abs=0.05)


@pytest.mark.parametrize("flies", [by_places, by_attitudes])
def test_a_program_is_never_given_the_vehicle_back_to_fly_into_the_same_wall_again(flies):
    air = hit(flies, then="previous")
    air.run_to(State.GIVING_BACK, 10.0)
    air.run_for(5.0)
    # It holds, in front of the wall, and has said why
    assert air.state is State.GIVING_BACK and len(air.vehicle.truth.hits) == 1
    assert air.guard.status().position_ned_m[0] < FACE_NORTH_M - 0.3
    assert len(air.told("not_back")) == 1
    # A person chooses; so does whoever stops the guard
    air.guard.stop("stopped")
    air.run_until(lambda: air.mode == "AUTO.LOITER", 2.0)


def test_a_program_that_turns_back_and_then_into_the_same_wall_again_is_stopped_before_it():
    # Given a program that has turned back after a hit, and has the vehicle again
    air = hit(by_places, then="previous")
    air.stop_all()
    north = [2.0]
    air.every(commanded.REPEATED_EVERY_S, lambda: air.place(north[0]))
    air.run_to(State.WATCHING, 10.0)
    air.run_for(3.0)
    assert air.mode == "OFFBOARD" and air.guard.status().position_ned_m[0] < 2.3
    # When it goes into the same wall, whose end nobody knows
    north[0] = 5.0
    air.run_to(State.GIVING_BACK, 0.3)
    air.run_for(5.0)
    # Then the vehicle stands before it, and has it back when it turns again
    assert len(air.vehicle.truth.hits) == 1 and air.guard.status().position_ned_m[0] < FACE_NORTH_M - 0.3
    north[0] = 1.0
    air.run_to(State.WATCHING, 0.5)
    air.run_for(3.0)
    assert air.guard.status().position_ned_m[0] < 1.3 and air.mode == "OFFBOARD"


@pytest.mark.parametrize("east_m", [-8.0, 8.0])
def test_far_beside_the_touch_a_surface_may_be_nearer_than_its_likely_direction_says(east_m):
    # Given a program that goes far aside, 0.7 m in front of a wall of which one touch is known
    air = hit(by_places, then="previous")
    air.stop_all()
    north = [FACE_NORTH_M - 0.7]
    air.every(commanded.REPEATED_EVERY_S, lambda: air.place(north[0], east_m))
    air.run_to(State.GIVING_BACK, 10.0)
    air.run_for(2.0)
    # Then it has the vehicle back when it is well in front, and not before
    assert air.state is State.GIVING_BACK
    north[0] -= 5.0
    air.run_to(State.WATCHING, 1.0)
    air.run_for(5.0)
    assert len(air.vehicle.truth.hits) == 1


def test_in_a_recovery_a_stick_is_obeyed_at_once():
    air = hit(by_places)
    pilot = sticks(air, 0.0)
    air.run_for(0.5)
    pilot()
    sticks(air, -0.6)
    assert air.state is State.RECOVERING
    assert air.run_until(lambda: air.mode == "POSCTL", 1.0) < TOO_LATE_S
    assert air.state is State.STOOD_DOWN


def test_in_a_recovery_a_request_for_offboard_does_not_arrive_and_a_disarm_does():
    air = hit(by_places)
    air.run_for(0.4)
    asked_s = air.time_s
    air.set_mode(OFFBOARD)
    air.command(ARM, 0, 21196)
    air.run_for(0.5)
    assert [message.command for message in air.sent_by("program", "COMMAND_LONG", asked_s)] == [ARM]
    assert air.guard.armed is False and air.state is State.STANDING_BY


def test_a_stream_that_a_program_slows_down_is_asked_for_again_and_one_that_it_speeds_up_is_not():
    air = BetweenFlight()
    air.run_to(State.STANDING_BY, 10.0)
    asked_s = air.time_s
    for message_id, interval_us in ((31, 1_000_000), (32, 10_000), (105, -1), (30, 1_000_000)):
        air.command(511, message_id, interval_us)
    air.run_for(0.1)
    again = [(round(m.param1), m.param2) for m in air.sent_by("guard", "COMMAND_LONG", asked_s)]
    assert [message_id for message_id, _ in again] == [31, 105]
    assert all(0 < interval_us <= 20_000 for _, interval_us in again)
    assert [kind for kind, _ in air.told_by_clients] == ["interval"] * 4
    # A group of them, which slows each down on an ArduPilot: all are asked for again
    asked_s = air.time_s
    air.send(dialect.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
    air.run_for(0.1)
    again = {round(m.param1) for m in air.sent_by("guard", "COMMAND_LONG", asked_s)}
    assert again >= {31, 32, 85, 105} and air.told_by_clients[-1] == (
        "interval",
        {"message_id": None, "interval_us": 0},
    )


def test_the_vehicles_questions_of_the_time_are_the_programs_to_answer_and_the_guards_answers_are_its_own():
    air = BetweenFlight()
    theirs = 8_000_000
    air.run_to(State.STANDING_BY, 10.0)
    air.send(dialect.MAVLink_timesync_message(0, theirs))
    air.run_for(1.5)
    sent = air.sent_by("guard", "TIMESYNC")
    assert sent and all(message.tc1 == 0 for message in sent), "the guard asks, and does not answer"
    heard = [message for _, message in air.heard if message.get_type() == "TIMESYNC"]
    assert {message.ts1 for message in heard if message.tc1} == {theirs}
    assert any(message.tc1 == 0 for message in heard)
    assert air.guard.core.flight.round_trip.median_us is not None


# --- the table


def packet_of(message, source=(255, 190)) -> bytes:
    return message.pack(dialect.MAVLink(None, *source))


def long(command, *params) -> bytes:
    return packet_of(dialect.MAVLink_command_long_message(1, 1, command, 0, *params, *[0.0] * (7 - len(params))))


NAN, NO_INT = math.nan, 0x7FFFFFFF
ANY_STICKS = dialect.MAVLink_manual_control_message(1, 500, 0, 500, 0, 0)


@pytest.mark.parametrize(
    ("packet", "is_kept_out"),
    [
        (packet_of(ANY_STICKS), False),
        (packet_of(ANY_STICKS, (1, 190)), False),
        (packet_of(ANY_STICKS, (1, 191)), True),
        (packet_of(dialect.MAVLink_rc_channels_override_message(1, 1, *[1500] * 8), (1, 195)), True),
        (packet_of(dialect.MAVLink_set_mode_message(1, 1, 6 << 16)), True),
        (packet_of(dialect.MAVLink_set_mode_message(1, 1, 3 << 16)), False),
        (long(176, 1, 6), True),
        (long(176, 1, 4, 6), False),
        (long(92, 1), True),
        (long(92, 0), False),
        (long(192, -1, 1, 0, NAN, 47.3, 8.5, 490), True),
        (long(192, -1, 1, 0, NAN, NAN, NAN, 490), True),
        (long(192, -1, 1, 0, NAN, NAN, NAN, NAN), False),
        (packet_of(dialect.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, NAN, NO_INT, NO_INT, NAN)), False),
        (packet_of(dialect.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, NAN, 473000000, 1, NAN)), True),
        (long(34, 5, 1, 0, 0, NAN, NAN, NAN), True),
        (long(20), False),
        (long(21), False),
        (long(185, 1), False),
        (long(400, 0, 21196), False),
    ],
)
def test_of_commands_sticks_and_modes_only_what_would_move_the_vehicle_is_kept_out(packet, is_kept_out):
    assert would_move(packet, PX4) is is_kept_out


def test_what_is_for_another_vehicle_on_the_same_link_passes_and_is_not_taken_for_this_ones():
    between = Between(LINK_BYTES_S)
    between.system_id = 1
    others = [
        packet_of(dialect.MAVLink_set_position_target_local_ned_message(1, 2, 1, 1, 0xDC7, *[0.0] * 11)),
        packet_of(dialect.MAVLink_set_attitude_target_message(1, 2, 1, 7, [1, 0, 0, 0], 0, 0, 0, 0.5)),
        packet_of(dialect.MAVLink_command_long_message(2, 1, 511, 0, 105, -1, 0, 0, 0, 0, 0)),
        packet_of(dialect.MAVLink_command_long_message(2, 1, 176, 0, 1, 6, 0, 0, 0, 0, 0)),
        packet_of(dialect.MAVLink_manual_control_message(2, 500, 0, 500, 0, 0), (1, 191)),
    ]
    between.hear("program", b"".join(others))
    assert between.to_vehicle(1_000_000) == others
    assert between.new_setpoint(1_000_000) is None and between.intervals == []


# --- bytes


def random_packet(chance: random.Random) -> bytes:
    """Of any message of the dialect, or of another one, in either version, perhaps signed; fields at random."""
    number = chance.choice(IDS) if chance.random() < 0.9 else chance.randrange(60_000, 61_000)
    message = dialect.mavlink_map.get(number)
    flags = chance.choice((0, 1))
    payload = chance.randbytes(chance.randrange(256) if message is None else chance.randint(1, message.unpacker.size))
    numbers = bytes(chance.randrange(256) for _ in range(3))  # sequence, system, component
    if number < 256 and chance.random() < 0.2:
        packet, flags = bytes((0xFE, len(payload))) + numbers + bytes((number,)) + payload, 0
    else:
        packet = bytes((0xFD, len(payload), flags, 0)) + numbers + number.to_bytes(3, "little") + payload
    extra = b"" if message is None else bytes((message.crc_extra,))
    return packet + mcrf4xx(packet[1:] + extra).to_bytes(2, "little") + chance.randbytes(13 * flags)


IDS = sorted(dialect.mavlink_map)


def pieces(content: bytes, chance: random.Random) -> list[bytes]:
    cuts = sorted(chance.sample(range(1, len(content)), len(content) // 200))
    return [content[start:end] for start, end in zip([0, *cuts], [*cuts, len(content)], strict=True)]


def test_packets_of_every_message_pass_both_ways_byte_by_byte_in_each_senders_order():
    # Given two clients and a vehicle, each with its own packets, cut anywhere
    chance = random.Random(1)
    said = {name: [random_packet(chance) for _ in range(10_000)] for name in ("a", "b", "vehicle")}
    between, now_us = Between(LINK_BYTES_S), 0
    between.is_closed = False
    passed, heard = list[bytes](), list[bytes]()
    cut = {name: iter(pieces(b"".join(packets), chance)) for name, packets in said.items()}
    # When they come as fast as the link carries them
    while cut or between.waits:
        now_us += 2_000
        for name in [*cut]:
            piece = next(cut[name], None)
            if piece is None:
                del cut[name]
            elif name == "vehicle":
                heard += between.to_clients(piece)
            else:
                between.hear(name, piece)
        passed += between.to_vehicle(now_us)
    # Then every byte is there, and a packet is never begun before another is at its end
    assert heard == said["vehicle"]
    of_a = set(said["a"])
    assert [packet for packet in passed if packet in of_a] == said["a"]
    assert [packet for packet in passed if packet not in of_a] == said["b"]
    assert {number for number in IDS if number not in {message_id_of(packet) for packet in passed}} == set()


def test_hostile_bytes_break_nothing_and_no_setpoint_passes_while_it_is_closed():
    chance = random.Random(3)
    between = Between(LINK_BYTES_S)
    for number in range(5_000):
        packet = bytearray(random_packet(chance))
        if chance.random() < 0.5:
            packet[chance.randrange(len(packet))] ^= 1 << chance.randrange(8)
        cut = bytes(packet[: chance.randrange(1, len(packet) + 1)]) if chance.random() < 0.2 else bytes(packet)
        between.hear("hostile", cut)
        between.to_clients(cut)
        for passed in between.to_vehicle(2_000 * number):
            assert packet_length(passed) == len(passed), "whole, as PX4 frames it"
            assert message_id_of(passed) not in SETPOINT_IDS
    assert between.kept_out > 20


# --- several clients


def test_a_client_that_floods_takes_no_turn_from_another_and_is_named():
    # Given a UART of 921,600 baud, and a client that sends a hundred times as much
    between, flood = Between(92_160), long(400, 1) * 30
    between.is_closed = False
    quiet = packet_of(ANY_STICKS, (1, 191))
    passed, waited_us, said_us = list[bytes](), list[int](), 0
    for now_us in range(0, 3_000_000, 1_000):
        for _ in range(8):
            between.hear("flood", flood)
        if now_us % 50_000 == 0:
            between.hear("quiet", quiet)
            said_us = now_us
        going = between.to_vehicle(now_us)
        if quiet in going:
            waited_us.append(now_us - said_us)
        passed += going
    # Then the link carries what it can, the other's sticks wait for a packet at most, and one sentence tells
    assert 0.5 * 3 * 92_160 < sum(map(len, passed)) <= 3 * 92_160 * (1 + BURST_S) + 1_000
    assert len(waited_us) == 60 and max(waited_us) <= 2_000
    assert [*between.news] == ["flood sends more than the link to the vehicle carries: the rest of it is lost"]
    assert not between.has_room("flood") and between.has_room("quiet")
    between.forget("flood")
    for now_us in range(3_000_000, 5_000_000, 1_000):
        between.to_vehicle(now_us)
    assert not between.waits and between.has_room("flood")
    # One that comes back by the same address loses no packet of which the rest comes later
    between.forget("quiet")
    between.hear("quiet", quiet[:9])
    between.to_vehicle(5_000_000)
    between.hear("quiet", quiet[9:])
    assert between.to_vehicle(5_000_000) == [quiet]
