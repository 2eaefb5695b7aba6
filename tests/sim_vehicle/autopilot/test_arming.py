"""Arming, disarming, and doing so by itself."""

from sim_vehicle.autopilot.commander.arming import Arming, Reason
from sim_vehicle.autopilot.messages import Result
from sim_vehicle.parameters.store import Parameters

SECOND = 1_000_000


def armed_at_zero() -> Arming:
    arming = Arming(Parameters())
    assert arming.arm(0, checks_pass=True) is Result.ACCEPTED
    return arming


def test_without_takeoff_it_disarms_after_eleven_seconds():
    arming = armed_at_zero()
    assert arming.disarm_by_itself(11 * SECOND - 4000, landed=True) is None
    assert arming.disarm_by_itself(11 * SECOND, landed=True) is Reason.INACTION
    assert not arming.armed


def test_after_a_flight_it_disarms_two_seconds_after_landing():
    # Given a flight that landed at 30 s, with a bounce at 31 s
    arming = armed_at_zero()
    assert arming.disarm_by_itself(20 * SECOND, landed=False) is None
    assert arming.disarm_by_itself(30 * SECOND, landed=True) is None
    assert arming.disarm_by_itself(31 * SECOND, landed=False) is None
    assert arming.disarm_by_itself(31 * SECOND + 4000, landed=True) is None
    # Then the two seconds count from the bounce
    assert arming.disarm_by_itself(33 * SECOND, landed=True) is None
    assert arming.disarm_by_itself(33 * SECOND + 4000, landed=True) is Reason.LANDING
