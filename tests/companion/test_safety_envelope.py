"""No setpoint leaves the envelope, whoever asks for it; and the conditions under which a mission ends."""

import itertools
import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.fly.packets import made
from companion.fence import Fence
from companion.flight.context import Target
from companion.flight.envelope import SetpointError, Surroundings, bounded
from companion.mission.item_trajectory import SpeedLimits
from companion.mission.policy import SetpointLimits
from companion.motion.config import GRAVITY_M_S2
from tests.companion.fake_vehicle import LAND, LANDING, LOITER, TAKEOFF, FakeVehicle, flight, hovering
from tests.companion.hostile import attacked

FENCE = Fence(radius_m=8, max_height_m=4, min_height_m=0.5)
LIMITS = SetpointLimits(max_speed_m_s=3.0, max_step_m=4.0)
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
    with pytest.raises(SetpointError):
        bounded(replace(good, yaw_rad=broken), around(), FENCE, LIMITS)


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


def test_one_position_outside_the_fence_ends_no_flight_and_two_do():
    f = hovering()

    def far(later_ms):
        fields = {"time_boot_ms": f.vehicle.time_us // 1000 + later_ms, "x": 40.0, "z": -1.5}
        return made("LOCAL_POSITION_NED", fields)

    # Given one forged packet between two of the vehicle's own, which come with every fifth interval
    f.run_until(lambda: f.vehicle.ticks % 5 == 1)
    attacked(f, [far(1)])
    f.run_for(0.5)
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
