"""No setpoint leaves the envelope, whoever asks for it; and the conditions under which a mission ends."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.context import Target
from companion.flight.envelope import Surroundings, bounded
from companion.flight.trajectory import LineProfile
from companion.mission.fence import Fence
from companion.mission.policy import Limits
from tests.companion.fake_vehicle import LAND, LOITER, FakeVehicle, flight

FENCE = Fence(radius_m=8, max_height_m=4, min_height_m=0.5)
LIMITS = Limits(max_speed_m_s=3.0, max_step_m=4.0)
ORIGIN = (100.0, -50.0, 2.0)
METRES = st.floats(-30, 30)
POINT = st.tuples(METRES, METRES, METRES)


def around(vehicle=(0.0, 0.0, -1.5), has_floor=True) -> Surroundings:
    local = tuple(v + o for v, o in zip(vehicle, ORIGIN, strict=True))
    return Surroundings(local, ORIGIN, has_floor)


def asked(place, velocity=None, acceleration=None) -> Target:
    return Target(tuple(p + o for p, o in zip(place, ORIGIN, strict=True)), 0.3, velocity, acceleration)


def place_of(target: Target) -> tuple:
    return tuple(p - o for p, o in zip(target.position_ned_m, ORIGIN, strict=True))


def test_what_is_inside_passes_untouched():
    target = asked((3.0, 1.0, -2.0), (2.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert bounded(target, around(), FENCE, LIMITS) == (target, "")


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


def test_a_velocity_is_scaled_down_in_its_direction():
    target, reason = bounded(asked((0.0, 0.0, -1.5), (3.0, 4.0, 0.0), (1.0, 0.0, 0.0)), around(), FENCE, LIMITS)
    assert target.velocity_ned_m_s == pytest.approx((1.8, 2.4, 0.0))
    assert reason == "velocity above 3 m/s"


def test_on_the_way_up_from_the_ground_there_is_no_floor():
    target = asked((0.0, 0.0, 0.0))
    assert bounded(target, around((0.0, 0.0, 0.0), has_floor=False), FENCE, LIMITS) == (target, "")


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

TAKEOFF = {"takeoff": {"height_m": 1.5}}


def in_mission(*items, vehicle=None, **changes):
    f = flight(vehicle, items=[TAKEOFF, *(items or [{"hold": {"duration_s": 60}}]), {"land": {}}], **changes)
    f.run_to("mission")
    f.run_for(0.2)
    return f


def test_the_stream_is_held_back_and_it_is_told():
    go_to = {"go_to": {"position_ned_m": [6, 0, -1.5], "speed_m_s": 2.0}}
    f = in_mission(go_to, {"hold": {"duration_s": 3}}, limits={"max_speed_m_s": 2.0})
    # as if something in the flight forgot the limit
    f.companion._core.machine.activity._way = LineProfile((0.0, 0.0, -1.5), (6.0, 0.0, -1.5), 4.0, 4.0)
    f.run_for(2.5)
    places = [(t, m.x) for t, m in f.vehicle.setpoints]
    assert max((b - a) / ((u - t) * 1e-6) for (t, a), (u, b) in itertools.pairwise(places)) == pytest.approx(2, 0.02)
    assert f.event("envelope").text.startswith("setpoint held back: moves faster than 2 m/s")
    f.run_for(1.5)
    assert f.vehicle.setpoints[-1][1].x == pytest.approx(6.0), "it arrives all the same"


def test_a_hit_may_make_the_setpoint_jump():
    into_wall = {"go_to": {"position_ned_m": [5, 0, -1.5], "speed_m_s": 2.0}}
    f = in_mission(
        into_wall, vehicle=FakeVehicle(wall_north_m=3.0), limits={"max_speed_m_s": 2.5}, recovery={"law": "paper"}
    )
    f.run_to("recovering")
    f.step()
    assert f.vehicle.setpoints[-1][1].x == pytest.approx(2.0, abs=0.15)


def test_an_estimate_that_jumps_does_not_send_the_vehicle_flying():
    f = in_mission(abort_when={"outside_fence_by_m": None}, fence={"radius_m": 30})
    f.vehicle.position[0] += 12.0
    f.step()
    f.run_for(0.1)
    last = f.vehicle.setpoints[-1][1]
    assert f.vehicle.position[0] - last.x == pytest.approx(5.0, abs=0.1), "limits.max_step_m"


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
    f = in_mission(vehicle=FakeVehicle(battery_percent=80), abort_when=condition, on_interrupt=on_interrupt)
    happens(f.vehicle)
    f.run_to("aborted", 6.0)
    assert words in f.companion.report().reason
    f.run_to_end()
    assert f.vehicle.mode == mode


def test_a_battery_that_is_low_or_unknown_is_no_battery_to_start_with():
    for percent, words in ((20, "battery at 20 %"), (None, "the vehicle says none")):
        f = flight(FakeVehicle(battery_percent=percent), abort_when={"battery_below_percent": 30})
        f.run_to("aborted")
        assert f.companion.report().outcome == "failed" and words in f.companion.report().reason
    f = flight(FakeVehicle(battery_percent=None))
    f.run_to("mission")
