"""Whatever is heard, every setpoint sent is finite and inside the envelope, and a step returns its result."""

import math
import random

import pytest
from pymavlink.dialects.v20 import development as mav

from bench.fly.packets import made
from tests.companion.fake_vehicle import INTO_WALL, at_wall, flying_in
from tests.companion.hostile import HEARD, STATES, Attacker, attacked

# These say in whose hands the vehicle is: forged, they end most flights before anything else is tried.
AUTHORITY = (
    mav.MAVLINK_MSG_ID_HEARTBEAT,
    mav.MAVLINK_MSG_ID_SYS_STATUS,
    mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    mav.MAVLINK_MSG_ID_CURRENT_MODE,
)


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize(("seed", "kinds"), [(1, HEARD), (2, sorted({*HEARD} - {*AUTHORITY}))])
def test_no_sequence_of_hostile_messages_breaks_a_step_or_the_envelope(state, seed, kinds):
    f, chance = flying_in(state), random.Random(seed)
    attacker = Attacker(f.vehicle, seed)
    for _ in range(250):
        attacked(f, [attacker.packet(chance.choice(kinds)) for _ in range(chance.choice((0, 0, 1, 1, 2)))])
    assert "fault" not in f.kinds(), f.texts()


def spinning(f) -> bytes:
    """A sample that has no number for one rate."""
    measured = {"time_usec": f.vehicle.time_us, "zacc": -9.8, "fields_updated": 0x3F}
    return made("HIGHRES_IMU", {**measured, "xgyro": math.nan})


def test_one_gyroscope_that_is_not_a_number_before_a_hit_costs_one_sample():
    f = at_wall(INTO_WALL)
    f.run_until(lambda: f.vehicle.position[0] > 3.0 - 0.032 * 2.0)
    attacked(f, [spinning(f)])
    for _ in range(500):
        attacked(f, [])
    assert [collision.impact_speed_m_s for collision in f.report.collisions] == pytest.approx([2.0], abs=0.2)
    assert f.report.refused_messages == {"HIGHRES_IMU": 1}
    assert "implausible" not in f.kinds(), "one packet is a matter for the count"


def test_gyroscopes_that_are_never_a_number_are_no_hits_but_told_and_end_the_mission():
    f = flying_in("mission")
    f.vehicle.no_imu = True
    for _ in range(3000):
        attacked(f, [spinning(f)])
    assert f.report.collisions == ()
    assert "HIGHRES_IMU is not accepted: specific force" in f.event("implausible").text
    assert f.kinds().count("implausible") == 1
    assert "blind" in f.report.reason
