"""Every failsafe with every value of its parameter: what flies, when, how the pilot ends it, how it ends by itself."""

import pytest

from sim_vehicle.autopilot.commander import failsafe_table
from sim_vehicle.autopilot.commander.failsafe import Failsafe
from sim_vehicle.autopilot.commander.failsafe_table import (
    MODE_OF,
    OFFBOARD_LOSS,
    Action,
    FailsafeSituation,
    FailsafeTrigger,
)
from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM, INJECT_FAILURE
from sim_vehicle.autopilot.flight_commands import DO_FLIGHTTERMINATION, DO_REPOSITION
from sim_vehicle.autopilot.messages import Result
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.parameters.store import Parameters
from tests.sim_vehicle.autopilot.kinematic_plant import Flight, hovering, in_offboard, set_mode, sticks, target

UP = target(position=(0.0, 0.0, -5.0))
FLYING = {"armed": True, "sticks_lost_at_arming": False}


def situation(**fields: object) -> FailsafeSituation:
    return FailsafeSituation(**{"intended": Mode.LOITER, **FLYING, **fields})  # type: ignore[arg-type]


def with_ground_station(**parameters: float) -> Flight:
    """In hold, its ground station heard for the last time just now."""
    flight = hovering(5.0, **{**parameters, "NAV_DLL_ACT": 0})
    flight.autopilot.ground_station_heard()
    flight.fly(0.1)
    flight.parameters.set("NAV_DLL_ACT", parameters["NAV_DLL_ACT"])
    return flight


def with_sticks(**parameters: float) -> Flight:
    flight = Flight(MIS_TAKEOFF_ALT=5.0, COM_RC_IN_MODE=1, COM_RC_OVERRIDE=0, **parameters)
    flight.autopilot.ground_station_heard()
    sticks(flight, 0.2, throttle=-1)
    set_mode(flight, Mode.TAKEOFF)
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    sticks(flight, 12.0)
    assert flight.autopilot.modes.flown is Mode.LOITER
    return flight


def until_it_acts(flight: Flight, at_most_s: float) -> float:
    return flight.fly_until(lambda: flight.autopilot.commander.failsafe.acts, at_most_s)


def flown(flight: Flight) -> Mode:
    return flight.autopilot.modes.flown


@pytest.mark.parametrize(("mode", "mask"), [(Mode.MISSION, 1), (Mode.LOITER, 2), (Mode.TAKEOFF, 2), (Mode.OFFBOARD, 4)])
def test_a_lost_link_can_be_excepted_in_a_mode(mode, mask):
    lost = situation(intended=mode, sticks_lost=True, ground_station_lost=True)
    both = {FailsafeTrigger.STICKS_LOST, FailsafeTrigger.GROUND_STATION_LOST}
    for excepted in (0, mask, 7 - mask):
        parameters = Parameters({"COM_RCL_EXCEPT": excepted, "COM_DLL_EXCEPT": excepted, "NAV_DLL_ACT": 2})
        found = {trigger for trigger, _ in failsafe_table.responses_now(lost, parameters)}
        assert found == (set() if excepted == mask else both)


def test_of_two_failsafes_the_later_in_the_order_wins():
    # Given a breached fence, which holds, and a lost ground station, after which it lands
    parameters = Parameters({"COM_FAIL_ACT_T": 0.0, "NAV_DLL_ACT": 3})
    now = situation(sticks_lost=False, fence_breached=True, ground_station_lost=True)
    assert Failsafe().update(0, now, parameters).action is Action.LAND
    # And a vehicle that returns already begins no return
    returning = situation(intended=Mode.RETURN, sticks_lost=False, ground_station_lost=True)
    assert Failsafe().update(0, returning, Parameters({**parameters, "NAV_DLL_ACT": 2})).action is Action.WARN


@pytest.mark.parametrize("value", OFFBOARD_LOSS)
def test_lost_setpoints_do_what_com_obl_rc_act_says(value):
    flight = in_offboard(UP, COM_OBL_RC_ACT=value)
    assert until_it_acts(flight, 2.0) == pytest.approx(1.07, abs=0.05)
    assert flown(flight) is MODE_OF[OFFBOARD_LOSS[value]]
    assert flight.autopilot.modes.intended is Mode.OFFBOARD
    assert "Failsafe activated" in flight.texts()


def test_a_lost_ground_station_is_waited_for_in_hold():
    flight = with_ground_station(NAV_DLL_ACT=2, COM_DL_LOSS_T=5.0)
    # COM_DL_LOSS_T counts from when the link calls it gone, 2.5 s after its last heartbeat
    flight.fly(7.3)
    assert not flight.autopilot.commander.failsafe.acts
    until_it_acts(flight, 0.5)
    assert "Connection to ground station lost" in flight.texts()
    # And most actions wait for COM_FAIL_ACT_T in hold
    assert "Failsafe activated: entering Hold for 5 seconds" in flight.texts()
    assert flown(flight) is Mode.LOITER
    flight.fly(5.1)
    assert flown(flight) is Mode.RETURN


def test_a_ground_station_that_comes_back_does_not_end_the_return_but_a_mode_does():
    flight = with_ground_station(NAV_DLL_ACT=2, COM_DL_LOSS_T=5.0, COM_FAIL_ACT_T=0.0)
    flight.fly(8.0)
    assert flown(flight) is Mode.RETURN
    flight.autopilot.ground_station_heard()
    flight.fly(1.0)
    assert "GCS connection regained" in flight.texts()
    assert flown(flight) is Mode.RETURN
    assert set_mode(flight, Mode.LOITER) is Result.ACCEPTED
    flight.fly(0.1)
    assert (flown(flight), flight.autopilot.commander.system_status) == (Mode.LOITER, 4)


@pytest.mark.parametrize(("value", "mode"), [(1, Mode.LOITER), (2, Mode.RETURN), (3, Mode.LAND)])
def test_lost_sticks(value, mode):
    flight = with_sticks(NAV_RCL_ACT=value, COM_FAIL_ACT_T=0.0)
    # COM_RC_LOSS_T, 0.5 s, is looked at every 200 ms; PX4 took 0.71 s
    assert until_it_acts(flight, 2.0) == pytest.approx(0.6, abs=0.05)
    assert flown(flight) is mode


def test_a_mode_chosen_in_the_delay_takes_over_at_once():
    flight = with_ground_station(NAV_DLL_ACT=2, COM_DL_LOSS_T=5.0)
    flight.fly(8.5)
    assert flown(flight) is Mode.LOITER and flight.autopilot.commander.system_status == 5
    assert set_mode(flight, Mode.LAND) is Result.ACCEPTED
    flight.fly(6.0)
    assert (flown(flight), flight.autopilot.commander.system_status) == (Mode.LAND, 4)


def test_sticks_take_over_from_a_failsafe():
    flight = with_sticks(NAV_DLL_ACT=2, COM_DL_LOSS_T=10.0, COM_FAIL_ACT_T=1.0)
    flight.parameters.set("COM_RC_OVERRIDE", 1)
    sticks(flight, 3.0)
    assert flown(flight) is Mode.RETURN
    sticks(flight, 0.3, pitch=1.0)
    assert (flown(flight), flight.autopilot.modes.intended) == (Mode.POSCTL, Mode.POSCTL)
    assert flight.autopilot.commander.system_status == 4


def test_terminated_is_for_good():
    flight = hovering(5.0)
    assert flight.ask(COMPONENT_ARM_DISARM, 0) is Result.TEMPORARILY_REJECTED
    assert flight.ask(DO_FLIGHTTERMINATION, 0) is Result.DENIED
    assert flight.ask(DO_FLIGHTTERMINATION, 1) is Result.ACCEPTED
    assert flight.autopilot.commander.system_status == 8
    assert not flight.autopilot.motors_run
    flight.fly(2.0)
    assert flight.height_m == 0.0
    assert set_mode(flight, Mode.LOITER) is Result.TEMPORARILY_REJECTED
    flight.ask(COMPONENT_ARM_DISARM, 0, 21196)
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.TEMPORARILY_REJECTED


def lose_gps(flight: Flight) -> None:
    assert flight.ask(INJECT_FAILURE, 4, 1) is Result.ACCEPTED


@pytest.mark.parametrize(("intended", "asked"), [(Mode.LOITER, None), (Mode.OFFBOARD, UP)])
def test_without_gps_the_position_is_lost_after_a_while_and_the_vehicle_descends(intended, asked):
    """Nor do setpoints of a place fly without one."""
    flight = hovering(5.0) if asked is None else in_offboard(UP, COM_OBL_RC_ACT=3)
    lose_gps(flight)
    flight.fly(4.9, asked)
    assert flown(flight) is intended
    flight.fly(0.2, asked)
    assert (flown(flight), flight.autopilot.modes.intended) == (Mode.DESCEND, intended)
    flight.fly_until(lambda: not flight.autopilot.arming.armed, 15.0)
    assert not flight.autopilot.commander.checks_pass


@pytest.mark.parametrize(("value", "arms"), [(0, False), (1, True)])
def test_whether_it_arms_without_gps_is_com_arm_wo_gps(value, arms):
    flight = Flight(COM_ARM_WO_GPS=value)
    lose_gps(flight)
    assert (flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED) is arms
    assert ("Preflight Fail: GPS fix too low" in flight.texts()) is not arms


def test_one_that_sees_the_ground_lands_without_gps_and_holds_again_with_it():
    flight = hovering(5.0)
    flight.autopilot.commander.positioning.sees_ground = True
    lose_gps(flight)
    flight.fly(5.1)
    assert (flown(flight), flight.autopilot.modes.intended) == (Mode.LAND, Mode.LOITER)
    assert flight.ask(DO_REPOSITION, -1, 1, 0, 0, 47.398, 8.5456) is Result.TEMPORARILY_REJECTED
    assert flight.texts()[-1] == "Switching to Hold is currently not available"
    flight.fly(0.6)
    assert flight.ask(INJECT_FAILURE, 4, 0) is Result.ACCEPTED
    flight.fly(5.0)
    assert flown(flight) is Mode.LOITER and abs(flight.state.position_ned_m[0]) < 1.0
