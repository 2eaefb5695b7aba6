"""Sticks: whose count, how they fly each mode, what they ask for by gesture."""

import math

import pytest

from sim_vehicle.autopilot.commander.manual_control import FIRST_LINK_SOURCE, RADIO_SOURCE, ManualInput
from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM
from sim_vehicle.autopilot.messages import RadioChannels, Result, StickInput
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.estimator.estimate import yaw_of
from sim_vehicle.parameters.store import Parameters
from tests.sim_vehicle.autopilot.flying import set_mode, sticks
from tests.sim_vehicle.autopilot.kinematic_plant import Flight

RADIO, FIRST, SECOND = RADIO_SOURCE, FIRST_LINK_SOURCE, FIRST_LINK_SOURCE + 1


def flying(mode: Mode, **parameters: float) -> Flight:
    """Taken off by the stick in POSCTL to some 5 m, then in ``mode`` with centred sticks."""
    flight = Flight(None, **parameters)
    sticks(flight, 0.2, throttle=-1.0)
    assert flight.autopilot.modes.flown is Mode.POSCTL
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    sticks(flight, 1.5)
    assert flight.height_m == 0.0
    for _ in range(40):
        sticks(flight, 0.25, throttle=0.8)
        if flight.height_m > 5.0:
            break
    sticks(flight, 4.0)
    if mode is not Mode.POSCTL:
        assert set_mode(flight, mode) is Result.ACCEPTED
    sticks(flight, 0.1)
    return flight


# --- whose sticks ------------------------------------------------------------------------------------------------

# COM_RC_IN_MODE: who flies after the first, and then the second, has begun to send; both go on.
CHOICES = [
    (0, RADIO, FIRST, RADIO, RADIO),
    (0, FIRST, RADIO, None, RADIO),
    (1, RADIO, FIRST, None, FIRST),
    (1, FIRST, SECOND, FIRST, FIRST),
    (2, FIRST, RADIO, FIRST, FIRST),
    (2, RADIO, FIRST, RADIO, RADIO),
    (3, FIRST, RADIO, FIRST, FIRST),
    (4, FIRST, RADIO, None, None),
    (5, FIRST, RADIO, FIRST, RADIO),
    (5, SECOND, FIRST, SECOND, FIRST),
    (6, RADIO, SECOND, RADIO, SECOND),
    (6, SECOND, FIRST, SECOND, FIRST),
    (7, SECOND, RADIO, SECOND, RADIO),
    (7, FIRST, SECOND, FIRST, SECOND),
    (8, RADIO, FIRST, RADIO, FIRST),
    (8, FIRST, SECOND, FIRST, SECOND),
]


def chosen(manual: ManualInput) -> int | None:
    return manual.sticks.source if manual.sticks is not None else None


@pytest.mark.parametrize(("mode", "first", "second", "alone", "both"), CHOICES)
def test_whose_sticks_count(mode, first, second, alone, both):
    manual = ManualInput(Parameters({"COM_RC_IN_MODE": mode}))
    manual.heard(StickInput(0, 0, 0, 0, first), 0)
    assert chosen(manual) == alone
    manual.heard(StickInput(0, 0, 0, 0, second), 20_000)
    assert chosen(manual) == both


def test_with_fallback_the_other_takes_over_and_with_the_first_kept_it_does_not():
    for mode, then in ((2, RADIO), (3, None)):
        manual = ManualInput(Parameters({"COM_RC_IN_MODE": mode, "COM_RC_LOSS_T": 0.5}))
        manual.heard(StickInput(0, 0, 0, 0, FIRST), 0)
        # Looked for every 200 ms: COM_RC_LOSS_T is over after 500, which shows after 600
        manual.update(599_000)
        assert chosen(manual) == FIRST
        manual.update(600_000)
        assert chosen(manual) is None
        manual.heard(StickInput(0, 0, 0, 0, RADIO), 610_000)
        assert chosen(manual) == then


def test_a_radios_channels_are_mapped_by_rc_map():
    manual = ManualInput(Parameters({"COM_RC_IN_MODE": 0, "RC_MAP_ROLL": 4, "RC_MAP_YAW": 1}))
    pulses = (1250, 2000, 1000, 1750, *[0] * 14)
    manual.heard_radio(RadioChannels(pulses), 0)
    assert manual.sticks == StickInput(roll=0.5, pitch=1.0, throttle=-1.0, yaw=-0.5, source=RADIO)
    # A radio that sends no throttle is none
    manual = ManualInput(Parameters({"COM_RC_IN_MODE": 0}))
    manual.heard_radio(RadioChannels((1500, 1500, 65535, 1500, *[0] * 14)), 0)
    assert manual.sticks is None


def test_only_a_stick_that_is_moved_fast_enough_counts_as_moved():
    # COM_RC_STICK_OV is 30 % a second
    for speed, moved in ((0.2, False), (0.5, True)):
        manual = ManualInput(Parameters({"COM_RC_IN_MODE": 1}))
        for number in range(50):
            manual.heard(StickInput(0.02 * speed * number, 0, 0, 0, FIRST), 20_000 * number)
        assert manual.moving is moved


# --- flown -------------------------------------------------------------------------------------------------------


def test_centred_sticks_hold_the_place():
    flight = flying(Mode.POSCTL)
    there = flight.state.position_ned_m
    sticks(flight, 5.0)
    assert math.dist(flight.state.position_ned_m, there) < 0.1


@pytest.mark.parametrize(
    ("held", "north", "east"),
    [({"pitch": 1.0}, 1, 0), ({"pitch": -1.0}, -1, 0), ({"roll": 1.0}, 0, 1), ({"roll": -1.0}, 0, -1)],
)
def test_a_full_stick_flies_at_mpc_vel_manual_and_brakes_when_let_go(held, north, east):
    flight = flying(Mode.POSCTL, MPC_VEL_MANUAL=6.0)
    sticks(flight, 12.0, **held)
    v_north, v_east, _ = flight.state.velocity_ned_m_s
    assert (v_north, v_east) == pytest.approx((6.0 * north, 6.0 * east), abs=0.3)
    sticks(flight, 5.0)
    assert math.hypot(*flight.state.velocity_ned_m_s) < 0.05


def test_forward_is_where_the_nose_points():
    flight = flying(Mode.POSCTL)
    sticks(flight, 2.0, yaw=0.5)
    sticks(flight, 1.0)
    yaw_rad = yaw_of(flight.state.attitude_wxyz)
    sticks(flight, 4.0, pitch=0.6)
    v_north, v_east, _ = flight.state.velocity_ned_m_s
    assert math.atan2(v_east, v_north) == pytest.approx(yaw_rad, abs=0.1)


def test_slow_position_mode_is_slow():
    flight = flying(Mode.POSITION_SLOW, MPC_VEL_MANUAL=10.0)
    sticks(flight, 8.0, pitch=1.0)
    assert flight.state.velocity_ned_m_s[0] == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize("mode", [Mode.POSCTL, Mode.ALTCTL])
def test_the_throttle_is_a_climb_and_centred_it_holds_the_height(mode):
    flight = flying(mode)
    before_m = flight.height_m
    sticks(flight, 3.0, throttle=1.0)
    assert -flight.state.velocity_ned_m_s[2] == pytest.approx(flight.parameters["MPC_Z_VEL_MAX_UP"], abs=0.2)
    sticks(flight, 4.0)
    held_m = flight.height_m
    assert held_m > before_m + 5.0
    sticks(flight, 5.0)
    assert flight.height_m == pytest.approx(held_m, abs=0.05)


def test_a_stick_within_the_dead_zone_is_centred():
    flight = flying(Mode.POSCTL)
    there = flight.state.position_ned_m
    sticks(flight, 5.0, pitch=0.09, roll=-0.09, throttle=0.09)
    assert math.dist(flight.state.position_ned_m, there) < 0.1


def test_pulled_down_it_lands_and_disarms():
    flight = flying(Mode.POSCTL)
    for _ in range(200):
        sticks(flight, 0.1, throttle=-1.0)
        if not flight.autopilot.arming.armed:
            break
    assert "Disarmed by landing" in flight.texts()


def test_in_altitude_mode_the_stick_leans_the_vehicle():
    flight = flying(Mode.ALTCTL)
    sticks(flight, 0.3, roll=0.5)
    asked = flight.autopilot.applied
    assert asked.acceleration_ned_m_s2[1] == pytest.approx(9.80665 * math.tan(math.radians(35.0)) * 0.5)
    assert asked.position_ned_m[:2] == (None, None)


def test_stabilised_sticks_are_angles_and_thrust():
    flight = flying(Mode.STABILIZED)
    sticks(flight, 0.1, roll=1.0)
    asked = flight.autopilot.applied
    w, x, y, z = asked.attitude_wxyz
    assert math.degrees(2 * math.atan2(x, w)) == pytest.approx(35.0, abs=0.1)
    assert (y, z) == pytest.approx((0.0, 0.0), abs=1e-6)
    # Hover thrust with the stick in the middle, all and next to nothing at its ends
    for stick, thrust in ((0.0, 0.5), (1.0, 1.0), (-1.0, 0.08)):
        sticks(flight, 0.1, throttle=stick)
        assert flight.autopilot.applied.thrust_fraction == pytest.approx(thrust)


def test_after_arming_the_throttle_waits_for_the_motors_and_then_rises_slowly():
    flight = Flight(None)
    sticks(flight, 0.2, throttle=-1.0)
    assert set_mode(flight, Mode.STABILIZED) is Result.ACCEPTED
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    # Given COM_SPOOLUP_TIME, 1 s; then half of the throttle a second, however far the stick is up
    for more_s, thrust in ((0.9, 0.0), (0.6, 0.25), (0.5, 0.5), (1.2, 1.0)):
        sticks(flight, more_s, throttle=1.0)
        assert flight.autopilot.applied.thrust_fraction == pytest.approx(thrust, abs=0.02)


def test_acro_sticks_are_rates():
    flight = flying(Mode.ACRO)
    sticks(flight, 0.1, roll=1.0, pitch=0.5, yaw=-1.0)
    rates = [math.degrees(rate) for rate in flight.autopilot.applied.rates_frd_rad_s]
    assert rates == pytest.approx([100.0, -50.0, -100.0])


# --- arming ------------------------------------------------------------------------------------------------------


def test_the_gestures_arm_and_disarm():
    flight = Flight()
    sticks(flight, 0.5, throttle=-1.0)
    sticks(flight, 0.9, throttle=-1.0, yaw=1.0)
    assert not flight.autopilot.arming.armed
    sticks(flight, 0.2, throttle=-1.0, yaw=1.0)
    assert flight.autopilot.arming.armed
    assert flight.texts()[-1] == "Armed by stick gesture"
    sticks(flight, 1.2, throttle=-1.0, yaw=-1.0)
    assert not flight.autopilot.arming.armed


@pytest.mark.parametrize(
    ("mode", "allowed", "falls"), [(Mode.STABILIZED, 1, True), (Mode.STABILIZED, 0, False), (Mode.ALTCTL, 1, False)]
)
def test_in_the_air_the_gesture_disarms_where_the_throttle_is_the_thrust_and_com_disarm_man_lets_it(
    mode, allowed, falls
):
    flight = flying(mode, COM_DISARM_MAN=allowed)
    flight.autopilot.texts.clear()
    sticks(flight, 1.2, throttle=-1.0, yaw=-1.0)
    assert flight.autopilot.arming.armed is not falls
    # A gesture that is refused is refused without a word
    assert "Disarming denied: not landed" not in flight.texts()


def test_backwards_and_to_the_side_it_may_be_slower():
    limits = {"MPC_VEL_MANUAL": 6.0, "MPC_VEL_MAN_SIDE": 3.0, "MPC_VEL_MAN_BACK": 2.0}
    for held, speed in (({"pitch": 1}, (6.0, 0.0)), ({"pitch": -1}, (-2.0, 0.0)), ({"roll": 1}, (0.0, 3.0))):
        flight = flying(Mode.POSCTL, **limits)
        sticks(flight, 8.0, **held)
        assert flight.state.velocity_ned_m_s[:2] == pytest.approx(speed, abs=0.15)


def test_a_gesture_does_not_arm_a_mode_that_sticks_do_not_fly():
    flight = Flight()
    set_mode(flight, Mode.LOITER)
    sticks(flight, 1.5, throttle=-1.0, yaw=1.0)
    assert not flight.autopilot.arming.armed
    assert flight.texts()[-1] == "Arming denied: switch to manual mode first"


@pytest.mark.parametrize(
    ("mode", "throttle", "why"),
    [
        (Mode.POSCTL, 0.5, "throttle above center"),
        (Mode.POSCTL, 0.0, None),
        (Mode.STABILIZED, 0.0, "high throttle"),
        (Mode.STABILIZED, -1.0, None),
    ],
)
def test_a_throttle_that_is_up_refuses_arming(mode, throttle, why):
    flight = Flight()
    set_mode(flight, mode)
    sticks(flight, 0.3, throttle=throttle)
    result = flight.ask(COMPONENT_ARM_DISARM, 1)
    assert result is (Result.TEMPORARILY_REJECTED if why else Result.ACCEPTED)
    assert flight.texts()[-1] == (f"Arming denied: {why}" if why else "Armed by external command")


def test_without_sticks_a_stick_mode_is_refused_in_the_air_and_cannot_be_armed():
    flight = Flight()
    set_mode(flight, Mode.POSCTL)
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.TEMPORARILY_REJECTED


def test_sticks_that_stop_in_a_stick_mode_are_a_failsafe():
    flight = flying(Mode.POSCTL, NAV_RCL_ACT=3, COM_FAIL_ACT_T=0.0)
    flight.fly(0.7)
    assert flight.autopilot.modes.flown is Mode.LAND
