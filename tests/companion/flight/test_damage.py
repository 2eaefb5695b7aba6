"""What a hit breaks: a crash is told once, and no vehicle disarmed that may fly; a motor that works harder is named."""

import math
import random

import pytest

from companion.flight.after_hit import note_motors
from companion.flight.plan import mission_lines
from companion.messages import ImuSample, LandedState, LocalPosition, MotorOutputs, Sample
from companion.motion.config import GRAVITY_M_S2
from companion.motion.motors import Damage, MotorWatch
from companion.motion.vector import plus
from companion.reflex.config import LIES_US, LOW_US, TIPPED_US
from companion.reflex.detection.crash import CrashWatch
from tests.companion.fake_vehicle import INTO_WALL, LANDING, TAKEOFF, FakeVehicle, flight, flying_in, mission
from tests.flying import Flight
from tests.simulated import flown, wall

ON_ITS_SIDE, ON_ITS_BACK, UPRIGHT = (0.0, GRAVITY_M_S2, 0.0), (0.0, 0.0, GRAVITY_M_S2), (0.0, 0.0, -GRAVITY_M_S2)
DISARM, FORCE, REFUSED, ACCEPTED = 400, 21196.0, 1, 0


def lies(f: Flight, height_m: float = 0.1, roll_deg: float = 90.0) -> None:
    """From now on, wherever it was; its weight is carried by what it lies on."""
    vehicle = f.vehicle
    vehicle.position[2], vehicle.velocity, vehicle.roll_rad = -height_m, [0.0, 0.0, 0.0], math.radians(roll_deg)
    roll = vehicle.roll_rad
    vehicle.specific_force = [0.0, -math.sin(roll) * GRAVITY_M_S2, -math.cos(roll) * GRAVITY_M_S2]
    vehicle.move = lambda: None


def disarms(f: Flight) -> list[float]:
    """Of each request: by how much force."""
    return [message.param2 for _, message in f.vehicle.commands if (message.command, message.param1) == (DISARM, 0.0)]


@pytest.mark.parametrize("state", ["takeoff", "mission", "recovering", "landing"])
def test_a_vehicle_that_is_tipped_over_for_half_a_second_has_crashed_and_its_setpoints_stop(state):
    f = flying_in(state)
    f.vehicle.roll_rad = math.radians(70.0)
    assert f.run_to("crashed", 2.0) == pytest.approx(1e-6 * TIPPED_US, abs=0.05)
    crashed_us = f.now_us
    f.run_for(2.0)
    assert [text.partition(",")[0] for text in f.told("crashed")] == ["crashed: tipped over"]
    assert f.setpoints_since(crashed_us) == []
    data = f.event("crashed").data
    assert data["tilt_deg"] == pytest.approx(70.0, abs=0.1) and data["speed_m_s"] >= 0.0


@pytest.mark.parametrize("state", ["mission", "recovering"])
def test_a_wreck_that_bounces_is_one_crash(state):
    # Given a vehicle that has crashed, and is reported
    f = flying_in(state)
    lies(f)
    f.run_to("crashed", 3.0)
    told = len(f.events)
    # When its parts settle with knocks
    for _ in range(5):
        f.run_for(0.3)
        f.vehicle.specific_force[0] += 80.0
        f.run_for(0.02)
        f.vehicle.specific_force[0] -= 80.0
    # Then nothing more is reported of it
    kinds = [event.kind for event in f.events[told:]]
    assert [kind for kind in kinds if kind in ("crash", "crashed", "contact", "detection")] == []


def test_on_the_floor_after_a_hit_it_has_crashed_also_where_it_stands_upright():
    f = flying_in("recovering")
    lies(f, roll_deg=0.0)
    assert f.run_to("crashed", 3.0) == pytest.approx(1e-6 * LOW_US, abs=0.1)
    assert f.told("crashed")[0].startswith("crashed: on the floor after a hit")


@pytest.mark.parametrize(("asked_m", "hovers_m"), [(0.25, 0.25), (0.32, 0.28)])
def test_a_low_hover_after_a_hit_that_did_not_settle_is_no_crash(asked_m, hovers_m):
    # Given a vehicle that is asked for little height, and has as much but for its estimate's error
    low = {"go_to": {"position_ned_m": [0, 0, -asked_m], "speed_m_s": 1.0}}
    items, slow = [TAKEOFF, INTO_WALL, low, {"hold": {"duration_s": 3}}, LANDING], {"speed_m_s": 1e-6, "timeout_s": 2.0}
    f = flight(
        FakeVehicle(wall_north_m=3.0), companion={"settled": slow}, items=items, on_collision={"then": "continue"}
    )
    while not f.told("item") or "hold" not in f.told("item")[-1]:
        f.run_for(0.1)
    f.run_for(1.0)
    f.vehicle.position[2], f.vehicle.velocity, f.vehicle.move = -hovers_m, [0.0, 0.0, 0.0], lambda: None
    f.run_for(1.8)
    assert "not settled" in f.event("recovered").text and f.told("crashed") == []


def test_what_is_still_pressed_to_a_wall_when_the_time_for_the_recovery_is_over_has_crashed():
    f = flying_in("recovering")
    f.vehicle.position[0] = f.companion.core.flight.collisions[-1].contact.position_ned_m[0]
    lies(f, height_m=1.5, roll_deg=0.0)
    f.vehicle.specific_force[0] = -2.5  # what it leans on pushes back
    assert f.run_to("crashed", 15.0) == pytest.approx(10.0, abs=0.5)
    assert f.told("crashed")[0].startswith("crashed: pressed to what was hit")
    f.run_for(5.0)
    assert disarms(f) == [], "it may fall"


def test_a_vehicle_that_lies_is_disarmed_at_last_by_force_and_the_flight_says_so():
    # Given a vehicle on its side that does not know that it has landed
    f = flying_in("mission")
    f.vehicle.ack = lambda command, count: [REFUSED if (command, count) == (DISARM, 2) else ACCEPTED]
    f.vehicle.obey = lambda command, count: (command, count) != (DISARM, 2)
    lies(f)
    # When it has lain for twice as long as makes sure of it
    assert f.run_until(lambda: bool(disarms(f)), 4.0) >= 1e-6 * LIES_US
    f.run_to("aborted", 6.0)
    # Then it was asked first, and forced after its refusal
    assert disarms(f)[:2] == [0.0, FORCE] and len(disarms(f)) <= 3, "a HEARTBEAT a second tells"
    assert f.report.outcome == "aborted" and f.report.reason == f.report.crashed
    assert f.report.crashed == "crashed: tipped over, tilted by 90 degrees"


def test_a_vehicle_that_stands_upright_is_never_forced():
    f = flying_in("recovering")
    f.vehicle.ack = lambda command, count: [REFUSED]
    f.vehicle.obey = lambda command, count: False
    lies(f, roll_deg=0.0)
    f.vehicle.landed = 1
    f.run_for(10.0)
    assert disarms(f) and set(disarms(f)) == {0.0}


def test_where_the_mission_says_tell_it_is_told_and_left_to_people():
    f = flying_in("mission", on_crash="tell")
    lies(f)
    f.run_for(6.0)
    assert (f.state, disarms(f)) == ("crashed", [])
    f.companion.stop("stopped with Ctrl-C")
    f.run_for(0.1)
    assert f.companion.finished and f.report.reason == "stopped with Ctrl-C" and f.report.crashed


def test_one_that_flies_again_is_in_other_hands():
    f = flying_in("mission")
    f.vehicle.roll_rad = math.radians(70.0)
    f.run_to("crashed", 2.0)
    f.vehicle.roll_rad, f.vehicle.mode, f.vehicle.intended = 0.0, 3 << 16, 3 << 16
    f.run_for(1.0)
    f.vehicle.move = lambda: None
    f.vehicle.position[0] += 1.0
    f.run_to("aborted", 1.0)
    assert f.report.reason.endswith("it flies again, in other hands") and disarms(f) == []


# --- what lies, and what may fly


def watched(force_frd, height_m=0.1, speed_m_s=0.0, rate_rad_s=0.0, landed=LandedState.IN_AIR) -> CrashWatch:
    """For three seconds, while its motors shake it."""
    watch = CrashWatch()
    for time_us in range(0, 3_000_000, 4_000):
        shake = 1.0 if time_us % 8_000 else -1.0
        force, rates = plus(force_frd, 0.2 * shake, force_frd), (rate_rad_s + 0.5 * shake, 0.0, 0.0)
        samples: list[Sample] = [ImuSample(time_us, force, rates)]
        if time_us % 20_000 == 0:
            samples.append(LocalPosition(time_us, (0.0, 0.0, 0.0), (0.0, 0.0, speed_m_s)))
        watch.update(samples, height_m, landed)
    return watch


@pytest.mark.parametrize("force_frd", [ON_ITS_SIDE, ON_ITS_BACK])
def test_what_is_carried_across_its_thrust_lies_and_what_moves_or_turns_or_is_high_does_not(force_frd):
    assert watched(force_frd).lying.lasts_us >= LIES_US
    for change in ({"height_m": 0.4}, {"height_m": None}, {"speed_m_s": 0.3}, {"rate_rad_s": 1.0}):
        assert watched(force_frd, **change).lying.lasts_us == 0
    assert watched(UPRIGHT).lying.lasts_us == 0, "so it hovers"
    assert watched(UPRIGHT, landed=LandedState.ON_GROUND).lying.lasts_us >= LIES_US


SAMPLE_US = 100_000
HOVER, NOISE = 500.0, 0.01
# As four motors differ by nature, and what a hit may change: shares of hover.
TRIM = (0.02, -0.03, 0.01, 0.0)
HURT = (0.0, 0.0, 0.16, 0.0)


class Flown:
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


def test_of_hours_without_a_hit_ten_minutes_are_kept():
    flown = Flown()
    flown.fly(750.0, False)
    assert len(flown.monitor._before) == 1200


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


def test_what_loads_a_motor_while_it_may_hang_on_the_wall_is_no_damage():
    # Given four motors that worked evenly until the hit, of which one works harder in the recovery
    context = flying_in("recovering").companion.core.flight
    for number in range(50):
        context.motors.take((1500.0,) * 4, False, number * SAMPLE_US)
    # Then it is named when the vehicle rests, and not before
    for began, settled_after_s in ((50, None), (150, 0.5)):
        context.collisions[-1].settled_after_s = settled_after_s
        for number in range(began, began + 100):
            note_motors(context, [MotorOutputs((1500.0, 1500.0, 1600.0, 1500.0))], number * SAMPLE_US)
        assert (context.motors.damage is None) == (settled_after_s is None)


@pytest.mark.parametrize(
    ("policy", "found_in", "state"),
    [
        ("tell", "mission", "mission"),
        ("land", "mission", "landing"),
        ("return", "mission", "returning"),
        ("land", "returning", "landing"),
    ],
)
def test_a_mission_says_what_follows(policy, found_in, state):
    f = flying_in(found_in, on_damage=policy)
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
