"""No setpoint leaves the envelope, whoever asks for it, whatever is heard; and when a mission ends."""

import itertools
import math
import random
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import development as mav

from bench.fly.packets import made
from companion.autopilot.px4.firmware import PX4
from companion.fence import Fence
from companion.flight.context import Target
from companion.flight.core import Limiter
from companion.flight.envelope import KnownSurface, SetpointError, Surroundings, bounded, unattended_text
from companion.flight.obstacle_map import known_surfaces
from companion.flight.plan import mission_lines
from companion.memory.surroundings import LEAST_FREE_M
from companion.mission.item_trajectory import SpeedLimits
from companion.mission.model import Mission
from companion.mission.policy import SetpointLimits
from companion.motion.config import GRAVITY_M_S2
from companion.motion.rotation import tilt_rad
from companion.reflex.belief.motion_estimator import Belief
from companion.reflex.config import HELD_S, MOST_HELD_S, NOTICED_S
from companion.reflex.recovery.attitude_law import Lean
from companion.reflex.surface import MotionState, Surface
from tests.companion import fake_vehicle
from tests.companion.fake_vehicle import LAND, LANDING, LOITER, TAKEOFF, FakeVehicle, flight, flying_in, hovering
from tests.companion.hostile import HEARD, STATES, Attacker, attacked

FENCE = Fence(radius_m=8, max_height_m=4, min_height_m=0.5)
LIMITS = SetpointLimits(max_speed_m_s=3.0, max_step_m=4.0)
ORIGIN = (100.0, -50.0, 2.0)
METRES = st.floats(-30, 30)
POINT = st.tuples(METRES, METRES, METRES)


def around(vehicle=(0.0, 0.0, -1.5)) -> Surroundings:
    local = tuple(v + o for v, o in zip(vehicle, ORIGIN, strict=True))
    return Surroundings(local, ORIGIN, True)


def asked(place, velocity=None, acceleration=None) -> Target:
    return Target(tuple(p + o for p, o in zip(place, ORIGIN, strict=True)), 0.3, velocity, acceleration)


def place_of(target: Target) -> tuple:
    return tuple(p - o for p, o in zip(target.position_ned_m, ORIGIN, strict=True))


@pytest.mark.parametrize(
    ("place", "vehicle", "expected", "reason"),
    [
        ((9.0, 0.0, -1.5), (7.0, 0.0, -1.5), (8.0, 0.0, -1.5), "outside the fence"),
        ((0.0, 0.0, -5.0), (0.0, 0.0, -3.0), (0.0, 0.0, -4.0), "outside the fence"),
        ((0.0, 0.0, 1.0), (0.0, 0.0, -1.5), (0.0, 0.0, -0.5), "outside the fence"),
        ((6.0, 0.0, -1.5), (0.0, 0.0, -1.5), (4.0, 0.0, -1.5), "more than 4 m from the vehicle"),
        # the vehicle is somewhere it must not be: the fence has the last word
        ((0.0, 0.0, -1.5), (20.0, 0.0, -1.5), (8.0, 0.0, -1.5), "more than 4 m from the vehicle, outside the fence"),
    ],
)
def test_a_place_outside_is_moved_in_and_stood_still_at(place, vehicle, expected, reason):
    target, said = bounded(asked(place, (1.0, 0.0, 0.0)), around(vehicle), FENCE, LIMITS)
    assert place_of(target) == pytest.approx(expected)
    assert said == reason
    assert (target.velocity_ned_m_s, target.acceleration_ned_m_s2, target.yaw_rad) == (None, None, 0.3)


def test_an_acceleration_is_bounded_by_the_tilt_and_by_gravity():
    place = (0.0, 0.0, -1.5)
    anywhere = Surroundings(None, None, True)
    target, reason = bounded(asked(place, (0.0, 0.0, 0.0), (60.0, 80.0, 0.0)), anywhere, FENCE, LIMITS)
    n, e, d = target.acceleration_ned_m_s2
    assert math.hypot(n, e) == pytest.approx(GRAVITY_M_S2), "45 degrees"
    assert e / n == pytest.approx(80 / 60) and d == 0.0
    assert reason == "tilt above 45 degrees"
    target, _ = bounded(asked(place, (0.0, 0.0, 0.0), (0.0, 0.0, -80.0)), anywhere, FENCE, LIMITS)
    assert target.acceleration_ned_m_s2[2] >= -GRAVITY_M_S2


@pytest.mark.parametrize("broken", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_a_fault_and_nothing_else(broken):
    good = asked((0.0, 0.0, -1.5), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    for index in range(3):
        for part in ("position_ned_m", "velocity_ned_m_s", "acceleration_ned_m_s2"):
            values = list(getattr(good, part))
            values[index] = broken
            spoilt: dict[str, Any] = {part: tuple(values)}
            with pytest.raises(SetpointError):
                bounded(replace(good, **spoilt), around(), FENCE, LIMITS)
    leans = Lean(Belief((0.0, 0.0, -1.5), (0.0, 0.0, 0.0), yaw_rate_rad_s=broken), (), 16.0, 0.4)
    for wrong in (replace(good, yaw_rad=broken), replace(good, lean=leans)):
        with pytest.raises(SetpointError):
            bounded(wrong, around(), FENCE, LIMITS)


def test_no_attitude_leans_further_than_the_limit():
    lean = Lean(Belief((0.0, 0.0, -1.5), (0.0, 0.0, 0.0)), (), 16.0, 0.4)
    leans = replace(asked((0.0, 0.0, -1.5), None, (5.0, 0.0, 0.0)), lean=lean)
    sent, _ = bounded(leans, around(), FENCE, SetpointLimits(max_tilt_deg=10.0))
    assert tilt_rad(sent.setpoint(0).attitude_wxyz) == pytest.approx(math.radians(10.0))


@given(POINT, POINT, st.one_of(st.none(), POINT))
def test_nothing_outside_the_envelope_ever_leaves(place, vehicle, velocity):
    target, _ = bounded(asked(place, velocity), around(vehicle), FENCE, LIMITS)
    north, east, down = place_of(target)
    # What the setpoint's single precision would round away, a hundredth of a millimetre, is not moved.
    assert math.hypot(north, east) <= 8.0 + 1.1e-5
    assert -4.0 - 1.1e-5 <= down <= -0.5 + 1.1e-5
    assert target.velocity_ned_m_s is None or math.hypot(*target.velocity_ned_m_s) <= 3.0 + 1e-9
    if FENCE.outside_by_m(vehicle) == 0.0 and vehicle[2] <= -0.5:
        assert math.dist(target.position_ned_m, around(vehicle).vehicle_ned_m) <= 4.0 + 1e-9
    again, reason = bounded(target, around(vehicle), FENCE, LIMITS)
    assert math.dist(again.position_ned_m, target.position_ned_m) < 1e-4 or "from the vehicle" in reason


# --- in flight


def test_the_stream_is_held_back_and_it_is_told():
    # Given a flight that has forgotten the limit
    go_to = {"go_to": {"position_ned_m": [6, 0, -1.5]}}
    f = flight(items=[TAKEOFF, go_to, {"hold": {"duration_s": 3}}, LANDING], limits={"max_speed_m_s": 2.0})
    f.run_to("takeoff")
    f.companion.core.flight.speeds = SpeedLimits(4.0, 4.0)
    f.run_to("mission")
    f.run_for(2.7)
    places = [(t, m.x) for t, m in f.vehicle.setpoints]
    assert max((b - a) / ((u - t) * 1e-6) for (t, a), (u, b) in itertools.pairwise(places)) == pytest.approx(2, 0.02)
    assert f.event("envelope").text.startswith("setpoint held back: moves faster than 2 m/s")
    f.run_for(1.5)
    assert f.vehicle.setpoints[-1][1].x == pytest.approx(6.0), "it arrives all the same"


CONDITIONS = [
    ({"outside_fence_by_m": 0.5}, lambda v: v.position.__setitem__(0, 16.0), "1.00 m outside the fence"),
    ({"setpoint_missed_by_m": 2.0}, lambda v: v.position.__setitem__(1, -3.0), "from its setpoint"),
    ({"battery_below_percent": 30}, lambda v: setattr(v, "battery_percent", 29), "battery at 29 %"),
    ({"flight_time_above_s": 8.0}, lambda v: None, "flight time above 8 s"),
    ({"blind_for_s": 3.0}, lambda v: setattr(v, "no_imu", True), "blind for 3 s"),
]


@pytest.mark.parametrize(("condition", "happens", "words"), CONDITIONS)
def test_a_condition_of_the_mission_ends_it(condition, happens, words):
    on_interrupt, mode = ("land", LAND) if "battery" in words else ("hold", LOITER)
    f = hovering(FakeVehicle(battery_percent=80), abort_when=condition, on_interrupt=on_interrupt)
    happens(f.vehicle)
    f.run_to("aborted", 6.0)
    assert words in f.report.reason
    f.run_to_end()
    assert f.vehicle.mode == mode


@pytest.mark.parametrize("ahead_ms", [1_200, 1_950])
def test_one_position_stamped_ahead_or_one_report_of_an_empty_battery_ends_no_flight(ahead_ms):
    f = hovering(FakeVehicle(battery_percent=80), abort_when={"battery_below_percent": 20})
    ahead = {"time_boot_ms": f.vehicle.time_us // 1000 + ahead_ms, "z": -1.5}
    attacked(f, [made("LOCAL_POSITION_NED", ahead), made("SYS_STATUS", {"battery_remaining": 0})])
    f.run_for(3.0)
    assert f.state == "mission"


def test_one_position_outside_the_fence_ends_no_flight_and_two_do():
    f = hovering()

    def far(later_ms):
        fields = {"time_boot_ms": f.vehicle.time_us // 1000 + later_ms, "x": 40.0, "z": -1.5}
        return made("LOCAL_POSITION_NED", fields)

    # Given one forged packet between two of the vehicle's own, which come with every fifth interval
    f.run_until(lambda: f.vehicle.ticks % 5 == 1)
    attacked(f, [far(1)])
    f.run_for(3.0)
    assert f.state != "aborted"
    # When two come in a row
    f.run_until(lambda: f.vehicle.ticks % 5 == 1)
    attacked(f, [far(1), far(2)])
    assert f.state == "aborted" and "outside the fence" in f.report.reason


def test_a_battery_that_is_low_or_unknown_is_no_battery_to_start_with():
    for percent, words in ((20, "battery at 20 %"), (None, "the vehicle says none")):
        f = flight(FakeVehicle(battery_percent=percent), abort_when={"battery_below_percent": 30})
        f.run_to("aborted")
        assert f.report.outcome == "failed" and words in f.report.reason
    f = flight(FakeVehicle(battery_percent=None))
    f.run_to("mission")


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
    f = fake_vehicle.at_wall(fake_vehicle.INTO_WALL)
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


DOCS = Path(__file__).parents[3] / "bench" / "notes" / "px4.md"
HOME = REST = (0.0, 0.0, 0.0)
ROOM, DEFAULTS = Fence(radius_m=12, max_height_m=5, min_height_m=0.3), SetpointLimits()
HERE = (0.0, 0.0, -1.5)
HELD_BY_ATTITUDE_S = MOST_HELD_S + NOTICED_S
# A wall that is touched with the centre 0.5 m north of here.
WALL = Surface((0.5, 0.0, -1.5), (-1.0, 0.0, 0.0), LEAST_FREE_M)


def before_wall(vehicle=HERE) -> Surroundings:
    return Surroundings(vehicle, HOME, True, known=[KnownSurface(WALL)])


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
    sent, _ = bounded(Target(here, 0.0, v, acceleration), before_wall(here), ROOM, DEFAULTS)
    # When PX4's own loops fly it on for as long as they hold it
    motion = MotionState(here, REST if is_slow else sent.velocity_ned_m_s)
    place, _ = flown(sent, motion, HELD_S + NOTICED_S)
    # Then it stays clear of the wall, the floor and the top
    assert WALL.off_m(place) >= WALL.distance_m - 0.02
    assert -ROOM.max_height_m - 0.02 <= place[2] <= -ROOM.min_height_m + 0.02


@pytest.mark.parametrize(("vehicle_off_m", "sent_off_m"), [(0.5, 0.15), (0.1, 0.1), (-0.1, -0.1), (-0.3, -0.4)])
def test_a_place_that_moves_stays_in_front_of_the_wall_or_as_near_as_the_vehicle_is(vehicle_off_m, sent_off_m):
    # Given a place that has moved on through the wall; one that the vehicle is behind is in a wrong place
    asked = Target((0.9, 0.2, -1.5), 0.0, REST)
    around = before_wall((0.5 - vehicle_off_m, 0.0, -1.5))
    sent, reason = bounded(asked, around, ROOM, DEFAULTS)
    assert WALL.off_m(sent.position_ned_m) == pytest.approx(sent_off_m)
    assert sent.position_ned_m[1:] == (0.2, -1.5) and bool(reason) is (sent_off_m > -0.4)


@pytest.mark.parametrize("off_m_s", [-1.0, 0.0, 0.8, 2.5])
def test_a_lean_that_is_held_leads_no_nearer_to_the_wall_than_can_be_braked(off_m_s):
    # Given a vehicle half a metre off the wall, and an acceleration to the wall and along it
    velocity = (-off_m_s, 0.3, 0.0)
    lean = Lean(Belief(HERE, velocity), (), 15.0, HELD_BY_ATTITUDE_S)
    asked = Target(HERE, 0.0, None, (6.0, 1.0, 0.0), lean)
    # When PX4 holds what is sent until it notices the silence, and then brakes with 3 m/s^2
    sent, _ = bounded(asked, before_wall(), ROOM, DEFAULTS)
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
        asked = Target(flown.vehicle.history.latest.position_ned_m, 0.0, (2.0, 0.5, 0.0), REST)
        sent = Limiter().passed(flown, asked, has_floor=True, moved=True, now_us=f.now_us)
        # Then it is held back
        assert sent.velocity_ned_m_s is None or sent.velocity_ned_m_s[0] < 1.9
        assert (wall.patch is None) is (state == "recovering")
    # and a hit that the vehicle is to come to rest behind holds nothing back
    flown.known, record.is_over = flown.mission.known, False
    (surface, *_) = record.surfaces = [replace(record.surfaces[0], normal_ned=(-0.6, 0.8, 0.0))]
    (wall,) = known_surfaces(flown)
    assert wall.surface.normal_ned == surface.normal_ned  # as it is known now
    record.setpoint_ned_m = (4.0, 0.0, -1.5)
    assert known_surfaces(flown) == []


def test_the_plan_says_for_how_long_a_setpoint_is_safe_that_nothing_follows():
    text = unattended_text(PX4)
    assert "COM_OF_LOSS_T" in text and "1 s" in text
    items = [{"takeoff": {"height_m": 2}}, {"land": {}}]
    assert f"Unattended {text}" in mission_lines(Mission.model_validate({"name": "short", "items": items}))


def test_a_setpoint_is_safe_for_as_long_as_a_real_px4_was_seen_to_hold_one():
    (row,) = [line for line in DOCS.read_text(encoding="utf-8").splitlines() if "last setpoint → hold" in line]
    longest_s = max(float(number) for number in re.findall(r"\d+\.\d+", row))
    assert HELD_S < longest_s <= HELD_S + NOTICED_S
