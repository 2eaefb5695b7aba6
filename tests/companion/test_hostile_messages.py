"""Whatever is heard, every setpoint sent is finite and inside the envelope, and a step returns its result."""

import math
import random

import pytest
from pymavlink.dialects.v20 import development as mav

from bench.fly.packets import made
from tests.companion.fake_vehicle import flying_in
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


def test_gyroscopes_that_are_never_a_number_are_no_hits_but_told_and_end_the_mission():
    f = flying_in("mission")
    f.vehicle.no_imu = True
    for _ in range(3000):
        measured = {"time_usec": f.vehicle.time_us, "zacc": -9.8, "fields_updated": 0x3F}
        attacked(f, [made("HIGHRES_IMU", {**measured, "xgyro": math.nan})])
    assert f.report.collisions == ()
    assert "HIGHRES_IMU is not accepted: specific force" in f.event("implausible").text
    assert f.kinds().count("implausible") == 1
    assert "blind" in f.report.reason
