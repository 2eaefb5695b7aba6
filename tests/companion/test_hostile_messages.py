"""Whatever is heard, every setpoint sent is finite and inside the envelope, and a step returns its result."""

import random

import pytest
from pymavlink.dialects.v20 import development as mav

from tests.companion.fake_vehicle import INTO_WALL, at_wall, flying_in
from tests.companion.hostile import HEARD, STATES, Attacker, attacked

# These say in whose hands the vehicle is: forged, they end most flights before anything else is tried.
AUTHORITY = (
    mav.MAVLINK_MSG_ID_HEARTBEAT,
    mav.MAVLINK_MSG_ID_SYS_STATUS,
    mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    mav.MAVLINK_MSG_ID_CURRENT_MODE,
)
GYROSCOPES = ("xgyro", "ygyro", "zgyro")


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize(("seed", "kinds"), [(1, HEARD), (2, sorted({*HEARD} - {*AUTHORITY}))])
def test_no_sequence_of_hostile_messages_breaks_a_step_or_the_envelope(state, seed, kinds):
    f, chance = flying_in(state), random.Random(seed)
    attacker = Attacker(f.vehicle, seed)
    for _ in range(250):
        attacked(f, [attacker.packet(chance.choice(kinds)) for _ in range(chance.choice((0, 0, 1, 1, 2)))])
    assert "fault" not in f.kinds(), f.texts()


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 3e38])
def test_every_field_of_every_message_alone_broken_in_a_recovery_changes_no_setpoint_to_nonsense(value):
    f = flying_in("recovering")
    attacker = Attacker(f.vehicle, 1)
    for message_id in HEARD:
        kind = mav.mavlink_map[message_id]
        floats = [name for name, of in zip(kind.fieldnames, kind.fieldtypes, strict=True) if of == "float"]
        for name in floats:
            attacked(f, [attacker.packet(message_id, name, value)])
    assert "fault" not in f.kinds(), f.texts()


def test_one_gyroscope_that_is_not_a_number_before_a_hit_costs_one_sample():
    f = at_wall(INTO_WALL)
    f.run_until(lambda: f.vehicle.position[0] > 3.0 - 0.032 * 2.0)
    attacker = Attacker(f.vehicle, 1)
    attacked(f, [attacker.packet(mav.MAVLINK_MSG_ID_HIGHRES_IMU, "xgyro", float("nan"))])
    for _ in range(500):
        attacked(f, [])
    assert [collision.impact_speed_m_s for collision in f.report.collisions] == pytest.approx([2.0], abs=0.2)
    assert f.report.refused_messages == {"HIGHRES_IMU": 1}
    assert "implausible" not in f.kinds(), "one packet is a matter for the count"


def test_gyroscopes_that_are_never_a_number_are_no_hits_but_told_and_end_the_mission():
    f = flying_in("mission")
    f.vehicle.no_imu = True
    attacker = Attacker(f.vehicle, 1)
    for _ in range(3000):
        attacked(f, [attacker.packet(mav.MAVLINK_MSG_ID_HIGHRES_IMU, name, float("nan")) for name in GYROSCOPES])
    assert f.report.collisions == ()
    assert "HIGHRES_IMU is not accepted: specific force" in f.event("implausible").text
    assert f.kinds().count("implausible") == 1
    assert "blind" in f.report.reason
