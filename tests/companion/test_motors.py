"""After a hit: which motor works harder than before, from a vehicle's outputs alone; and what a mission wants then."""

import random

import pytest

from companion.companion import Companion
from companion.flight.damage import note_motors
from companion.flight.plan import mission_lines
from companion.messages import LandedState, MotorOutputs
from companion.mission.model import Mission
from companion.motion.motors import WINDOW_US, Damage, MotorWatch
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle
from tests.companion.fake_vehicle import FakeVehicle, flight, mission
from tests.flying import EPOCH_US

SAMPLE_US = 100_000
HOVER, NOISE = 500.0, 0.01
# As four motors differ by nature, and what a hit may change: shares of hover.
TRIM = (0.02, -0.03, 0.01, 0.0)
HURT = (0.0, 0.0, 0.16, 0.0)


class Flown:
    """A vehicle's outputs ten times a second."""

    def __init__(self, zero=1000.0, most=2000.0, seed=1):
        self.monitor, self.now_us = MotorWatch(), 0
        self._zero, self._most, self._random = zero, most, random.Random(seed)

    def fly(self, seconds, was_hit, change=(0.0,) * 4, hover=HOVER, manoeuvre=0.0):
        told = []
        for number in range(round(seconds * 1e6 / SAMPLE_US)):
            self.now_us += SAMPLE_US
            turn = manoeuvre * (1 if number // 10 % 2 else -1)
            shares = [
                1.0 + trim + more + sign * turn + self._random.gauss(0.0, NOISE)
                for trim, more, sign in zip(TRIM, change, (1, -1, 1, -1), strict=True)
            ]
            outputs = [min(self._zero + hover * share, self._most) for share in shares]
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


def test_nothing_is_told_that_the_healthy_flight_has_shown_too_or_that_too_few_moments_show():
    agile = Flown()
    agile.fly(20.0, False, manoeuvre=0.25)
    assert agile.fly(20.0, True, HURT) == []
    short = Flown()
    short.fly(1.5, False)
    assert short.fly(2.0, True, HURT) == []


def test_a_motor_that_gives_all_it_has_is_named_although_another_is_spared_for_it():
    flown = Flown(most=1550.0)
    flown.fly(5.0, False)
    (damage,) = flown.fly(20.0, True, (0.0, -0.3, 0.3, 0.0))
    assert damage.motor == 3 and damage.is_at_limit and ", all it has" in damage.text


def test_outputs_that_begin_at_zero_are_shares_of_what_they_are():
    flown = Flown(zero=0.0)
    flown.monitor.take((100.0,) * 4, None, 0)  # idling, as DShot has it
    flown.fly(5.0, False)
    (damage,) = flown.fly(20.0, True, HURT)
    assert damage.harder == pytest.approx(0.16, abs=0.01)


def test_a_recovery_says_nothing_and_what_came_before_it_counts_anew():
    flown = Flown()
    flown.fly(5.0, False)
    assert flown.fly(20.0, None, HURT) == []
    assert flown.fly(1.4, True, HURT) == [] and flown.fly(0.5, None) == []
    assert len(flown.fly(20.0, True, HURT)) == 1


def test_each_flight_of_a_vehicle_begins_anew_and_only_quadrotors_in_the_air_are_looked_at():
    f = flight(FakeVehicle())
    f.run_to("mission")
    context = f.companion.core.flight
    context.vehicle.landed = LandedState.IN_AIR

    def watched(seconds):
        for number in range(round(seconds * 1e6 / WINDOW_US) * 10):
            note_motors(context, [MotorOutputs((1500.0,) * 4)], f.now_us + number * SAMPLE_US)
        return len(context.motors._before)

    assert watched(5.0) > 0
    context.vehicle.landed = LandedState.ON_GROUND
    before = len(context.motors._before)
    assert watched(5.0) == before
    context.vehicle.armed = False
    note_motors(context, [], f.now_us)
    assert not context.motors._before


def test_a_vehicle_that_did_not_come_to_rest_hangs_or_lies_and_its_motors_say_nothing():
    f = flight(FakeVehicle(wall_north_m=3.0), items=[INTO_WALL[0], INTO_WALL[2], INTO_WALL[4]])
    f.run_until(lambda: "recovered" in f.kinds())
    context = f.companion.core.flight
    context.vehicle.landed = LandedState.IN_AIR

    def moments_after():
        for number in range(50):
            note_motors(context, [MotorOutputs((1500.0,) * 4)], f.now_us + number * SAMPLE_US)
        return len(context.motors._after)

    assert moments_after() > 5
    context.collisions[-1].settled_after_s = None
    assert moments_after() == 0


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


WALL = {"point_ned_m": [4, 0, -1.5], "normal_ned": [-1, 0, 0], "width_m": 6, "height_m": 3}
INTO_WALL = [
    {"takeoff": {"height_m": 1.5}},
    {"hold": {"duration_s": 3}},
    {"go_to": {"position_ned_m": [7, 0, -1.5], "speed_m_s": 2.0}},
    {"hold": {"duration_s": 6}},
    {"land": {}},
]


def flown_into_a_wall(airframe, faults=(), **changes):
    scene = Scene.model_validate({"walls": [WALL], "faults": list(faults)})
    vehicle = SimulatedVehicle(load_built_in(airframe), scene, 1, keeps_path=False)
    wanted = {"name": "wall", "items": INTO_WALL, "companion": {"streams": {"window_s": 0.5}}, **changes}
    companion, events, sent = Companion(Mission.model_validate(wanted)), [], b""
    companion.confirm_plan()
    while not companion.finished:
        result = companion.step(b"".join(vehicle.step(sent)), EPOCH_US + vehicle.time_boot_us)
        events += result.events
        sent = b"".join(result.sent_frames)
    return events


def hits(events):
    return [event.data["sample_time_boot_us"] / 1e6 for event in events if event.kind == "detection"]


@pytest.mark.slow
@pytest.mark.parametrize("airframe", ["foldable", "rigid"])
def test_each_motor_that_a_hit_hurts_is_named_and_none_that_it_does_not(airframe):
    # Given a hit that hurts nothing
    healthy = flown_into_a_wall(airframe)
    (hit_s,) = hits(healthy)
    assert [event for event in healthy if event.kind == "damage"] == []
    # When it costs a propeller a twentieth of its blades, or a motor a fifth of its thrust
    for motor, share in enumerate((0.86, 0.8, 0.86, 0.8)):
        hurt = {"kind": "motor_failure", "motor": motor, "thrust_share": share, "at_s": hit_s + 0.01}
        events = flown_into_a_wall(airframe, [hurt], on_damage="land")
        # Then that one is named, and the vehicle lands
        (told,) = [event for event in events if event.kind == "damage"]
        assert told.data["motor"] == motor + 1 and told.data["harder"] > 0.1
        assert told.text.endswith("; then: land")
