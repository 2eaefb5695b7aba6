"""Where a setpoint leads that nothing follows, and what the envelope makes of one that leads into something."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.autopilot.px4.firmware import PX4
from companion.core import Limiter
from companion.fence import Fence
from companion.flight.context import Target
from companion.flight.envelope import KnownSurface, Surroundings, bounded, touched, unattended_text
from companion.flight.obstacle_map import known_surfaces
from companion.flight.plan import mission_lines
from companion.mission.model import Mission
from companion.mission.policy import SetpointLimits
from companion.reflex.attitude_law import Belief, Lean
from companion.reflex.config import HELD_S, MOST_HELD_S, NOTICED_S
from companion.reflex.laws import MotionState
from tests.companion.fake_vehicle import flying_in

DOCS = Path(__file__).parents[2] / "bench" / "notes" / "px4.md"
ORIGIN = (0.0, 0.0, 0.0)
REST = (0.0, 0.0, 0.0)
FENCE, LIMITS = Fence(radius_m=12, max_height_m=5, min_height_m=0.3), SetpointLimits()
HERE = (0.0, 0.0, -1.5)
HELD_BY_ATTITUDE_S = MOST_HELD_S + NOTICED_S
# A wall that is touched with the centre 0.5 m north of here.
WALL = touched((0.5, 0.0, -1.5), (-1.0, 0.0, 0.0))


def around(known=(), vehicle=HERE) -> Surroundings:
    return Surroundings(vehicle, ORIGIN, True, known=known)


def lean(acceleration, velocity=REST, place=HERE) -> Target:
    return Target(place, 0.0, None, acceleration, Lean(Belief(place, velocity), (), 15.0, 0.0, HELD_BY_ATTITUDE_S))


def flown(target: Target, motion: MotionState, seconds: float) -> tuple[tuple, tuple]:
    """PX4's loops in steps of a millisecond, by their gains' defaults."""
    place, velocity = list(motion.position_ned_m), list(motion.velocity_ned_m_s)
    wanted, ahead = target.velocity_ned_m_s or REST, target.acceleration_ned_m_s2 or REST
    for _ in range(round(seconds * 1e3)):
        for axis, (k_x, k_v) in enumerate(((0.95, 1.8), (0.95, 1.8), (1.0, 4.0))):
            pulled = k_v * (wanted[axis] + k_x * (target.position_ned_m[axis] - place[axis]) - velocity[axis])
            velocity[axis] += 1e-3 * (pulled + ahead[axis])
            place[axis] += 1e-3 * velocity[axis]
    return tuple(place), tuple(velocity)


@given(
    st.tuples(*[st.floats(-3.0, 3.0)] * 3), st.tuples(*[st.floats(-6.0, 6.0)] * 2), st.floats(-0.9, 0.3), st.booleans()
)
def test_no_setpoint_beside_the_wall_leads_a_vehicle_that_follows_it_there_while_px4_holds_it(v, a, north_m, is_slow):
    # Given any velocity and acceleration, asked for at a place off the wall where the vehicle flies as asked
    here, acceleration = (north_m, 0.0, -1.5), (*a, 0.0)
    sent, _ = bounded(Target(here, 0.0, v, acceleration), around([KnownSurface(WALL)], here), FENCE, LIMITS)
    # When PX4's own loops fly it on for as long as they hold it
    motion = MotionState(here, REST if is_slow else sent.velocity_ned_m_s)
    place, _ = flown(sent, motion, HELD_S + NOTICED_S)
    # Then it stays clear of the wall, the floor and the top
    assert WALL.off_m(place) >= WALL.distance_m - 0.02
    assert -FENCE.max_height_m - 0.02 <= place[2] <= -FENCE.min_height_m + 0.02


@pytest.mark.parametrize("off_m_s", [-1.0, 0.0, 0.8, 2.5])
def test_a_lean_that_is_held_leads_no_nearer_to_the_wall_than_can_be_braked(off_m_s):
    # Given a vehicle half a metre off the wall, and an acceleration to the wall and along it
    velocity = (-off_m_s, 0.3, 0.0)
    asked = lean((6.0, 1.0, 0.0), velocity)
    # When PX4 holds what is sent until it notices the silence, and then brakes with 3 m/s^2
    sent, _ = bounded(asked, around([KnownSurface(WALL)]), FENCE, LIMITS)
    north_m_s = velocity[0] + HELD_BY_ATTITUDE_S * sent.acceleration_ned_m_s2[0]
    north_m = HERE[0] + 0.5 * HELD_BY_ATTITUDE_S * (velocity[0] + north_m_s)
    # Then it stops off the wall, where physics allows that at all, and along the wall nothing is taken
    stops_m = north_m + 0.5 * max(0.0, north_m_s) ** 2 / 3.0
    assert WALL.off_m((stops_m, 0.0, -1.5)) >= WALL.distance_m - 1e-6
    assert sent.acceleration_ned_m_s2[1] == 1.0 and sent.acceleration_ned_m_s2[0] <= 6.0
    # and what leaves fast enough may brake as hard as it likes
    assert (sent.acceleration_ned_m_s2[0] == 6.0) is (off_m_s == 2.5)


def test_a_flights_setpoints_keep_off_what_it_has_just_hit_and_off_what_it_remembers():
    # Given a vehicle that comes off a wall 3 m north
    f = flying_in("recovering")
    f.run_for(0.2)
    flown, record = f.companion.core.flight, f.companion.core.flight.collisions[-1]
    # When something asks for 2 m/s back into it, in the recovery and after it
    for state in ("recovering", "holding"):
        f.run_to(state)
        (wall,) = known_surfaces(flown)
        assert wall.surface.normal_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.05)
        asked = Target(flown.vehicle.history.latest().position_ned_m, 0.0, (2.0, 0.5, 0.0), REST)
        sent = Limiter().passed(flown, asked, has_floor=True, moved=True, now_us=f.now_us)
        # Then it is held back
        assert sent.velocity_ned_m_s is None or sent.velocity_ned_m_s[0] < 1.9
        assert (wall.patch is None) is (state == "recovering")
    # and a hit that the vehicle is to come to rest behind holds nothing back
    flown.patches, record.is_over = (), False
    assert len(known_surfaces(flown)) == 1
    record.setpoint_ned_m = (4.0, 0.0, -1.5)
    assert known_surfaces(flown) == []


def test_what_a_longer_loss_costs_is_told_in_metres():
    text = unattended_text(PX4, 2.5)
    assert "COM_OF_LOSS_T" in text and "1 s" in text and "2.5 m" in text
    # in the plan by the fastest item
    items = [
        {"takeoff": {"height_m": 2}},
        {"go_to": {"position_ned_m": [1, 0, -2], "speed_m_s": 1.7}},
        {"velocity": {"velocity_ned_m_s": [1.5, 2.0, 0], "duration_s": 1}},
        {"land": {}},
    ]
    lines = mission_lines(Mission.model_validate({"name": "fast", "items": items}))
    assert f"Unattended {text}" in lines


def test_a_setpoint_is_safe_for_as_long_as_a_real_px4_was_seen_to_hold_one():
    (row,) = [line for line in DOCS.read_text(encoding="utf-8").splitlines() if "last setpoint → hold" in line]
    longest_s = max(float(number) for number in re.findall(r"\d+\.\d+", row))
    assert HELD_S < longest_s <= HELD_S + NOTICED_S
