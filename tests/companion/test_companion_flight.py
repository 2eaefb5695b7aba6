"""Whole flights on the wire against a scripted vehicle: take-off, items, hits, recoveries, landing."""

import itertools
import math

import pytest

from tests.companion.fake_vehicle import INTO_WALL, LANDING, TAKEOFF, FakeVehicle, at_wall, flight, hovering, strike


def test_a_mission_without_a_hit_completes():
    f = flight()
    report = f.run_to_end()
    assert (report.outcome, report.autopilot, report.collisions) == ("completed", "PX4 1.15.0", ())
    assert report.stream_rates_hz["HIGHRES_IMU"] == pytest.approx(250, rel=0.01)
    assert report.stream_rates_hz["LOCAL_POSITION_NED"] == pytest.approx(50, rel=0.01)
    assert report.started_at_us < report.armed_at_us < report.ended_at_us
    assert [k for k in f.kinds() if k not in ("mode", "item", "loss")] == [
        *("connected", "streams", "plan", "takeoff", "armed", "detector", "landing", "contact", "disarmed", "done")
    ]


def test_coordinates_are_relative_to_where_the_vehicle_is_when_it_arms():
    f = flight(FakeVehicle(start_ned_m=(9.7, -4.0, 0.5)))
    f.run_to("takeoff")
    f.vehicle.position[0] = 10.0  # pushed while the setpoints were already streaming
    f.run_to("landing")

    assert f.report.origin_ned_m == pytest.approx((10.0, -4.0, 0.5), abs=1e-3)
    assert f.vehicle.position == pytest.approx([10.0, -2.0, -1.0], abs=0.25)
    last = f.vehicle.setpoints[-1][1]
    assert last.yaw == pytest.approx(math.pi / 2)


def test_setpoints_lead_the_mode_switch_by_a_second_never_pause_in_flight_and_end_with_the_landing():
    f = flight()
    f.run_until(lambda: f.vehicle.armed)
    assert {round(m.z, 3) for _, m in f.vehicle.setpoints} == {0.0}, "on the ground until then"
    f.run_until(lambda: "landing" in f.kinds())

    times = [t for t, _ in f.vehicle.setpoints]
    offboard_at = next(t for t, m in f.vehicle.commands if m.command == 176)
    arm_at = next(t for t, m in f.vehicle.commands if m.command == 400)
    assert offboard_at - times[0] >= 1_000_000
    assert arm_at > offboard_at
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert max(gaps) <= 50_000, "20 Hz or faster"
    assert {m.type_mask for _, m in f.vehicle.setpoints} == {0x800, 0x9F8}
    landing_at = f.now_us
    f.run_to_end()
    assert f.setpoints_since(landing_at) == []


def test_nothing_arms_before_the_plan_is_confirmed():
    f = flight(confirmed=False)
    f.run_until(f.companion.plan_is_ready)
    f.run_for(20.0)
    assert f.state == "ready"
    assert {m.command for _, m in f.vehicle.commands} <= {511, 512}
    assert f.vehicle.setpoints == []
    plan = f.companion.plan_text()
    said = ("PX4 1.15.0", "quadrotor", "take off to 1.5 m", "15 m", "6 m", "recovery law adaptive", "hold for 3 s")
    assert all(words in plan for words in (*said, "HIGHRES_IMU"))

    f.companion.confirm_plan()
    f.run_to("takeoff", 0.1)


def test_the_hit_is_answered_in_the_step_that_hears_of_it_and_reported_as_it_was():
    # Steady when it meets the wall: the accelerometer of a vehicle that stays level does not show how it speeds up.
    steady = {"flight": {"speeding_up_m_s2": 2.0}}
    f = at_wall(INTO_WALL, recovery={"law": "paper", "gamma": 0.5}, companion=steady)
    f.run_until(lambda: "detection" in f.kinds())

    contact_us = f.vehicle.contact_times_us[0]
    detection = f.event("detection")
    assert detection.data["sample_time_boot_us"] - contact_us <= 8000, "the first or second IMU sample"
    recovery = f.setpoints_since(detection.time_us - 1)
    assert recovery, "the setpoint leaves in the same step"
    _, m = recovery[-1]
    assert (m.x, m.y, m.z) == pytest.approx(detection.data["recovery_setpoint_ned_m"], abs=1e-4)
    assert m.type_mask == 0x9F8

    (hit,) = f.run_to_end().collisions
    assert hit.impact_velocity_ned_m_s == pytest.approx((2.0, 0.0, 0.0), abs=0.15)
    assert hit.position_ned_m == pytest.approx((3.0, 0.0, -1.5), abs=0.05)
    assert hit.normal_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.01)
    v_n = hit.impact_velocity_ned_m_s[0]
    assert hit.recovery_setpoint_ned_m[0] == pytest.approx(hit.position_ned_m[0] - 0.5 * v_n)
    assert 45.0 < hit.peak_specific_force_m_s2 < 75.0
    assert 0.5 < hit.settled_after_s < 4.0
    assert 0.3 < hit.rebound_speed_m_s < 1.5
    assert 0.0 <= hit.overshoot_m < 0.1


@pytest.mark.parametrize(
    ("state", "after_s", "detector"), [("takeoff", 1.6, "off (below 0.5 m)"), ("landing", 2.2, "armed")]
)
def test_what_shakes_a_takeoff_or_a_landing_is_no_hit(state, after_s, detector):
    f = flight()
    f.run_to(state)
    f.run_for(after_s)
    assert f.companion.status().detector.startswith(detector)
    strike(f, 15.0, 15.0)
    f.run_to_end()
    assert f.report.collisions == () and "landing" in f.event("contact").text


def test_a_fall_to_the_ground_is_told_as_a_crash():
    f = hovering()
    f.vehicle.position[2] = -0.5
    for _ in range(10):
        f.vehicle.velocity[2] = 4.0
        f.step()
    strike(f, 60.0, 0.0)
    crash = f.event("crash")
    assert crash.data["down_m_s"] > 3.5 and "tilted by 0 degrees" in crash.text


def test_a_recovery_that_does_not_settle_is_reported_and_the_mission_goes_on():
    f = at_wall(INTO_WALL, companion={"settled": {"speed_m_s": 1e-6, "timeout_s": 2.0}})
    f.run_to("recovering")
    f.run_to("holding", 3.0)
    assert "not settled" in f.event("recovered").text
    report = f.run_to_end()
    assert report.outcome == "completed"
    assert report.collisions[0].settled_after_s is None


def test_headings_turn_the_shorter_way_at_a_limited_rate():
    items = [TAKEOFF, LANDING]
    turn = {"position_ned_m": [0, 0, -1.5], "speed_m_s": 1.0}
    items[1:1] = [{"go_to": {**turn, "yaw_deg": 170}}, {"go_to": {**turn, "yaw_deg": -170}}]
    f = flight(items=items)
    f.run_until(lambda: len([e for e in f.events if e.kind == "item"]) == 2)
    began = f.vehicle.time_us
    f.run_to("landing")
    yaws = [m.yaw for t, m in f.vehicle.setpoints if t > began]
    assert all(abs(math.remainder(yaw - math.pi, math.tau)) < math.radians(10.5) for yaw in yaws)
    steps = [abs(math.remainder(b - a, math.tau)) for a, b in itertools.pairwise(yaws)]
    assert max(steps) <= math.radians(45) * 0.021
