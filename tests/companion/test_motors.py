"""After a hit: which motor works harder than before, from a vehicle's outputs alone; and what a mission wants then."""

import random

import pytest

from companion.flight.plan import mission_lines
from companion.motion.motors import Damage, MotorWatch
from tests.companion.fake_vehicle import FakeVehicle, flight, mission
from tests.flying import Flight
from tests.simulated import flown, wall

SAMPLE_US = 100_000
HOVER, NOISE = 500.0, 0.01
# As four motors differ by nature, and what a hit may change: shares of hover.
TRIM = (0.02, -0.03, 0.01, 0.0)
HURT = (0.0, 0.0, 0.16, 0.0)


class Flown:
    """A vehicle's outputs ten times a second."""

    def __init__(self, most=2000.0):
        self.monitor, self.now_us = MotorWatch(), 0
        self._most, self._random = most, random.Random(1)

    def fly(self, seconds, was_hit, change=(0.0,) * 4, hover=HOVER):
        told = []
        for _ in range(round(seconds * 1e6 / SAMPLE_US)):
            self.now_us += SAMPLE_US
            shares = [
                1.0 + trim + more + self._random.gauss(0.0, NOISE) for trim, more in zip(TRIM, change, strict=True)
            ]
            outputs = [min(1000.0 + hover * share, self._most) for share in shares]
            damage = self.monitor.take(tuple(outputs), was_hit, self.now_us)
            told += [] if damage is None else [damage]
        return told


def test_a_motor_that_lifts_less_is_named_with_how_much_harder_it_works_and_how_surely():
    flown = Flown()
    assert flown.fly(5.0, False) == []
    (damage,) = flown.fly(20.0, True, HURT)
    assert damage.motor == 3 and damage.harder == pytest.approx(0.16, abs=0.01) and not damage.is_at_limit
    assert 0.99 <= damage.confidence < 1.0
    assert damage.text.startswith("motor 3 works 16% harder than before (99.")


@pytest.mark.parametrize(
    ("change", "hover"),
    [
        ((0.0, 0.0, 0.0, 0.0), HOVER),
        # The battery sags: all four
        ((0.0, 0.0, 0.0, 0.0), 1.2 * HOVER),
        # A load that has shifted, to the side of two and towards one
        ((0.1, -0.1, -0.1, 0.1), HOVER),
        ((0.16, -0.16, 0.0, 0.0), HOVER),
        # Yaw alone, as of a bent arm
        ((0.1, 0.1, -0.1, -0.1), HOVER),
        # Less than half of what a twentieth of a blade takes
        ((0.0, 0.0, 0.03, 0.0), HOVER),
    ],
)
def test_what_is_no_motors_own_is_not_told(change, hover):
    flown = Flown()
    flown.fly(5.0, False)
    assert flown.fly(30.0, True, change, hover) == []


def test_a_motor_that_gives_all_it_has_is_named_although_another_is_spared_for_it():
    flown = Flown(most=1550.0)
    flown.fly(5.0, False)
    (damage,) = flown.fly(20.0, True, (0.0, -0.3, 0.3, 0.0))
    assert damage.motor == 3 and damage.is_at_limit and ", all it has" in damage.text


def test_a_recovery_says_nothing_and_what_came_before_it_counts_anew():
    flown = Flown()
    flown.fly(5.0, False)
    assert flown.fly(20.0, None, HURT) == []
    assert flown.fly(1.4, True, HURT) == [] and flown.fly(0.5, None) == []
    assert len(flown.fly(20.0, True, HURT)) == 1


@pytest.mark.parametrize(("policy", "state"), [("tell", "mission"), ("land", "landing"), ("return", "returning")])
def test_a_mission_says_what_follows(policy, state):
    f = flight(FakeVehicle(), on_damage=policy)
    f.run_to("mission")
    f.run_for(1.0)
    f.companion.core.flight.motors.damage = Damage(3, 0.16, 0.995, False)
    f.step()
    assert f.state == state
    lines = [line for line in mission_lines(mission(on_damage=policy)) if line.startswith("On damage")]
    assert len(lines) == (policy != "tell")


def flown_into_a_wall(*faults, airframe, **keys) -> Flight:
    sim = {"walls": [wall(4.0)], "faults": faults, "airframe": airframe}
    north = {"go_to": {"position_ned_m": [7, 0, -1.5], "speed_m_s": 2.0}}
    before, after = ({"hold": {"duration_s": duration_s}} for duration_s in (3, 6))
    return flown(before, north, after, companion={"streams": {"window_s": 0.5}}, sim=sim, **keys)


@pytest.mark.slow
@pytest.mark.parametrize("airframe", ["foldable", "rigid"])
def test_each_motor_that_a_hit_hurts_is_named_and_none_that_it_does_not(airframe):
    # Given a hit that hurts nothing
    healthy = flown_into_a_wall(airframe=airframe)
    assert healthy.told("damage") == [] and healthy.kinds().count("detection") == 1
    hit_s = healthy.event("detection").data["sample_time_boot_us"] / 1e6
    # When it costs a propeller a twentieth of its blades
    for motor, share in enumerate((0.86, 0.86, 0.86, 0.86)):
        hurt = {"kind": "motor_failure", "motor": motor, "thrust_share": share, "at_s": hit_s + 0.01}
        flight = flown_into_a_wall(hurt, airframe=airframe, on_damage="land")
        # Then that one is named, and the vehicle lands
        assert flight.kinds().count("damage") == 1
        told = flight.event("damage")
        assert told.data["motor"] == motor + 1 and told.data["harder"] > 0.1
        assert told.text.endswith("; then: land")


@pytest.mark.slow
def test_a_hexarotor_that_loses_a_motor_says_so_and_lands_though_it_never_quite_rests():
    dead = {"kind": "motor_failure", "motor": 2, "thrust_share": 0.0, "at_s": 13.1}
    flight = flown_into_a_wall(dead, airframe="hexa", on_damage="land")
    assert flight.event("detection").data["sample_time_boot_us"] > 13.1e6
    assert flight.event("recovered").data["settled_after_s"] is None
    told = flight.event("damage")
    assert told.data["motor"] == 3 and ", all it has" in told.text
    assert flight.event("done").data["reason"].startswith("landed and disarmed")
