"""The guard on a program's own connection: none of the program's setpoints reaches the vehicle while it holds."""

import pytest

from companion.guard.attached import Gate
from companion.guard.config import GuardConfig
from companion.guard.holding import is_foreign
from companion.guard.states import State
from companion.messages import PositionTarget, Refused
from companion.px4_mode import AUTO_LOITER, OFFBOARD
from tests.guard.attached_air import REPEATED_EVERY_S, AttachedAir


@pytest.fixture(scope="module")
def air() -> AttachedAir:
    air = AttachedAir()
    air.fly_into_the_wall()
    air.until(lambda: air.state is State.WATCHING, 10.0)
    air.run(2.0)
    return air


def test_not_one_of_the_programs_setpoints_reaches_the_vehicle_while_the_guard_holds(air):
    held_s = (air.event_s("take_over"), air.event_s("given_back"))
    assert held_s[1] - held_s[0] > 0.5
    assert air.setpoints("program", held_s[0] + 0.004, held_s[1] + 0.004) == []
    # it went on sending all the while, and was heard before and after
    expected = (held_s[1] - held_s[0]) / REPEATED_EVERY_S
    assert air.guard.kept_out == pytest.approx(expected, abs=2)
    assert len(air.setpoints("program", held_s[0] - 1.0, held_s[0])) == pytest.approx(20, abs=1)
    assert len(air.setpoints("program", held_s[1] + 0.1, held_s[1] + 1.1)) == pytest.approx(20, abs=1)


def test_the_guards_own_setpoints_carry_the_vehicle_meanwhile_from_the_hit_on(air):
    taken_s = air.event_s("take_over")
    own = air.setpoints("guard", taken_s, air.event_s("given_back"))
    assert len(own) == pytest.approx(50 * (air.event_s("given_back") - taken_s), abs=3)
    first_s = next(at for at, who, name, _ in air.on_wire if who == "guard" and at >= taken_s)
    assert first_s - taken_s <= 0.004
    assert own[-1]["x"] < 3.7


def test_in_the_programs_own_offboard_nothing_is_streamed_beforehand_and_nothing_needs_confirming(air):
    taken_s = air.event_s("take_over")
    assert air.setpoints("guard", taken_s - 1.0, taken_s) == []
    assert [
        name for at, who, name, _ in air.on_wire if who == "guard" and abs(at - taken_s) < 0.1 and "LONG" in name
    ] == []
    assert next(event for event in air.events if event.kind == "confirmed").data["after_ms"] == 0.0


def test_it_is_given_back_to_hold_where_the_programs_setpoints_mean_nothing(air):
    assert air.mode == AUTO_LOITER
    assert len([event for event in air.events if event.kind == "detection"]) == 1


def test_the_programs_own_heartbeats_and_time_questions_have_none_of_the_guards_beside_them(air):
    sent = {name for _, who, name, _ in air.on_wire if who == "guard"}
    assert "COMMAND_LONG" in sent and not sent & {"HEARTBEAT", "TIMESYNC"}


def test_given_back_to_the_program_its_setpoints_count_again_until_the_hits_allowed_are_used_up():
    air = AttachedAir(GuardConfig(then="previous", max_hits=2))
    air.fly_into_the_wall()
    air.until(lambda: air.state is State.WATCHING, 10.0)
    assert air.mode == OFFBOARD
    given_back_s = air.time_s
    air.until(lambda: air.guard.core.machine.holds, 10.0)
    assert len(air.setpoints("program", given_back_s, air.time_s)) > 5
    air.until(lambda: air.state is State.WATCHING, 10.0)
    assert air.mode == AUTO_LOITER


def test_a_program_that_commands_a_mode_while_the_guard_holds_has_its_way():
    air = AttachedAir()
    air.fly_into_the_wall()
    air.run(0.2)
    air.set_mode(4, 3)
    air.until(lambda: air.state is State.STOOD_DOWN, 1.0)
    assert air.mode == AUTO_LOITER


def test_the_guard_makes_way_for_a_programs_setpoints_before_its_offboard():
    """Both streams together would have the vehicle stop and go in the first tenth of a second."""
    air = AttachedAir()
    air.until(lambda: air.state is State.STANDING_BY, 10.0)
    air.run(2.0)
    air.command(400, 1)
    air.run(0.5)
    air.command(22)
    air.until(lambda: air.state is State.WATCHING, 20.0)
    air.run(2.0)
    assert len(air.setpoints("guard", air.time_s - 1.0)) == pytest.approx(10, abs=1)
    air.set_velocity((0.0, 0.0, 0.0))
    air.run(0.1)
    began_s = air.time_s
    air.run(1.0)
    assert air.setpoints("guard", began_s) == []


def test_the_gate_knows_its_own_by_content_and_each_but_once():
    gate = Gate()
    own = {"time_boot_ms": 7, "type_mask": 0xDF8, "x": 1.0, "y": 2.0, "z": -3.0}
    gate.sends(own)
    assert not gate.is_own({**own, "x": 1.1})
    assert not gate.is_own({**own, "time_boot_ms": 8})
    assert gate.is_own({**own, "x": 1.0000000298})
    assert not gate.is_own(own)


def test_what_the_samples_say_is_the_same_by_fields_as_by_bytes():
    from pymavlink.dialects.v20 import development as dialect

    from companion.mavlink.decode import Decoder
    from companion.mavlink.readers import GUARD_READERS, sample_from
    from sim_vehicle.airframe import load_built_in
    from sim_vehicle.scene import Scene
    from sim_vehicle.vehicle import SimulatedVehicle
    from tests.guard.attached_air import fields_of

    vehicle = SimulatedVehicle(load_built_in("foldable"), Scene(), 1)
    decoder, parser = Decoder(GUARD_READERS), dialect.MAVLink(None)
    decoder.listen_to(1, 1)
    kinds = set()
    for _ in range(1000):
        for packet in vehicle.step(b""):
            sample = decoder.feed(packet)[0][1]
            message = parser.decode(bytearray(packet))
            by_fields = sample_from(message.get_type(), (1, 1), fields_of(message))
            assert by_fields == sample, message.get_type()
            kinds.add(type(sample).__name__)
    assert kinds >= {"ImuSample", "LocalPosition", "Attitude", "AttitudeTarget", "Heartbeat", "PositionTarget"}


def test_fields_of_another_dialect_make_no_sample_and_no_error():
    from companion.mavlink.readers import sample_from

    assert sample_from("HIGHRES_IMU", (1, 1), {"message_id": 105}) is None
    assert sample_from("HEARTBEAT", (1, 1), {"type": None, "custom_mode": None}) is None
    assert sample_from("NO_SUCH_MESSAGE", (1, 1), {}) is None
    imu = {"time_usec": 1, "xacc": None, "yacc": 0.0, "zacc": 0.0, "xgyro": 0.0, "ygyro": 0.0, "zgyro": 0.0}
    assert isinstance(sample_from("HIGHRES_IMU", (1, 1), {**imu, "fields_updated": 63}), Refused)


def test_an_echo_is_a_strangers_unless_the_guard_asked_for_that_place_or_for_a_lean_of_late():
    guard = AttachedAir().guard.core.flight
    there, elsewhere, no_place = (PositionTarget(place) for place in ((1.0, 0.0, -2.0), (2.0, 0.0, -2.0), None))
    guard.sent_ned_m.append((1_000_000, (1.1, 0.0, -2.0)))
    assert [is_foreign(guard, echo, 1_100_000) for echo in (there, elsewhere, no_place)] == [False, True, True]
    guard.sent_ned_m.append((1_100_000, None))
    assert [is_foreign(guard, echo, 1_200_000) for echo in (there, elsewhere, no_place)] == [False, True, False]
    assert is_foreign(guard, no_place, 1_600_000)


def test_a_stiff_hit_after_which_the_guard_leans_is_recovered_from_in_peace():
    air = AttachedAir(airframe="rigid")
    air.fly_into_the_wall(2.5)
    air.until(lambda: air.state is State.WATCHING, 10.0)
    kinds = [event.kind for event in air.events]
    assert "recovered" in kinds and "crossed" not in kinds
    assert any(fields["x"] is None for fields in air.setpoints("guard", air.event_s("take_over")))
    assert air.setpoints("program", air.event_s("take_over") + 0.004, air.event_s("given_back")) == []
