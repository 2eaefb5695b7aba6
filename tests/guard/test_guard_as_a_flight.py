"""What the guard does as a flight does: the ground, forged reports, and a person's mode of just before."""

import pytest
from pymavlink.dialects.v20 import development as dialect

from companion.guard.states import State
from tests.guard.flying import EPOCH_US, MANUAL_POSITION, Air
from tests.guard.test_guard_flights import pushed_into_the_wall


def recovering() -> Air:
    air = Air()
    pushed_into_the_wall(air)[0] = 0.0
    air.until(lambda: air.state is State.RECOVERING, 1.0)
    return air


def test_a_vehicle_that_a_hit_throws_down_is_watched_to_the_ground():
    air = Air()
    air.take_off()
    core = air.guard.core
    north, east, down = air.position()
    core.flight.origin_ned_m = (north, east, down + 0.05)
    air.step()
    assert core.situation().off_reason is None


def test_a_mode_that_a_person_chose_just_before_the_vehicle_is_given_back_is_not_overruled():
    air = recovering()
    air.mode(MANUAL_POSITION)
    air.step()
    air.step()
    assert air.vehicle_mode() == "OFFBOARD", "the report that shows it is yet to come"
    air.guard.stop("stopped")
    stopped_s = air.time_s
    air.run(1.0)
    assert air.vehicle_mode() == "POSCTL"
    asked = [m for at, who, m in air.on_wire if who == "guard" and at > stopped_s and m.get_type() == "COMMAND_LONG"]
    assert [message for message in asked if message.command == 176] == []


@pytest.mark.parametrize(("armed", "main_mode"), [(0, 6), (0x80, 3)])
def test_one_forged_heartbeat_does_not_end_a_recovery(armed, main_mode):
    air = recovering()
    forged = dialect.MAVLink_heartbeat_message(2, 12, armed | 1, main_mode << 16, 4, 3)
    air.guard.step(bytes(forged.pack(dialect.MAVLink(None, 1, 1))), EPOCH_US + air.vehicle.time_boot_us)
    # PX4 repeats CURRENT_MODE twice a second, whatever it is asked for
    air.run(0.6)
    assert air.state in (State.RECOVERING, State.GIVING_BACK)
    assert len([text for text in air.told("implausible") if "conflicting" in text]) == 1
