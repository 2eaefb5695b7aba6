"""Hits where a vehicle leans, hangs or lands: answered like any other, and it neither tips over nor falls."""

import numpy as np
import pytest

from tests.simulated import SimulatedFlight, flown, simulated, wall

pytestmark = pytest.mark.flight

FAST = {"go_to": {"position_ned_m": [9, 0, -3], "speed_m_s": 4.0, "acceleration_m_s2": 3.0, "yaw_deg": 0}}


def in_room(*items, then="land", height_m=3.0, obstacles=(), **sim) -> SimulatedFlight:
    fence = {"radius_m": 12, "max_height_m": 6}
    keys = {"on_collision": {"then": then}, "fence": fence, "obstacles": dict(obstacles)}
    return flown(*items, height_m=height_m, sim=sim, **keys)


def at_the_hit(flight) -> int:
    """The sample of the truth before it."""
    return int(np.searchsorted(flight.series["time_boot_us"], flight.hits[0].contact_at_boot_us)) - 1


def sunk_m(flight) -> float:
    """Within two seconds of the hit."""
    at, down_m = at_the_hit(flight), flight.series["position_ned_m"][:, 2]
    return float(down_m[at : at + 500].max() - down_m[at])


def test_a_wall_met_while_speeding_up_does_not_tip_the_vehicle_over():
    # Given a wall a metre ahead, and an item that allows for 3 m/s^2, with which the vehicle would lean by 21 degrees
    flight = in_room(FAST, walls=[wall(1.18)])
    # Then it meets the wall while it speeds up, nearly level, and stays so
    assert flight.hits[0].impact_velocity_ned_m_s[0] > 1.0
    assert flight.tilt_deg[at_the_hit(flight)] < 11.0 and flight.tilt_deg.max() < 35.0
    assert sunk_m(flight) < 0.1


def test_a_take_off_that_is_tried_again_is_slower_each_time():
    # Given a ceiling in the way of the climb
    ceiling = wall(0.0) | {"point_ned_m": [0, 0, -2.2], "normal_ned": [0, 0, 1]}
    flight = in_room({"hold": {"duration_s": 1}}, then="retry", walls=[ceiling])
    # Then it meets it at half of the speed each time, but not below 0.3 m/s
    speeds_m_s = [collision.impact_speed_m_s for collision in flight.report.collisions[:3]]
    assert speeds_m_s == pytest.approx([1.0, 0.5, 0.3], abs=0.06)
    assert flight.report.outcome == "completed", flight.report.reason


def test_a_vehicle_that_hangs_on_a_wall_is_let_go_of():
    # Given a slanted wall, met while the vehicle climbs beside it at 2.6 m/s: what clipping hides leaves its velocity
    # wrong for half a second, and the hit turns it towards the wall until it hangs on it
    slanted = {"name": "wall", "point_ned_m": [-2.716, -1.101, -3], "normal_ned": [0.959, 0.283, 0], "width_m": 5}
    start = {"go_to": {"position_ned_m": [0.524, -0.208, -1.433], "speed_m_s": 2}}
    into = {"go_to": {"position_ned_m": [-4.661, 0.131, -2.515], "speed_m_s": 2.777, "acceleration_m_s2": 2.266}}
    flight = in_room(start, into, walls=[slanted], wind_ned_m_s=[1.439, -0.038, 0], start={"yaw_deg": 98})
    hit, at, tilt_deg = flight.hits[0], at_the_hit(flight), flight.tilt_deg
    assert hit.impact_velocity_ned_m_s[0] < -2.3 and tilt_deg[at : at + 50].max() > 20.0
    # Then it is off it before its own thrust tips it over, with next to no height lost
    assert tilt_deg.max() < 40.0 and sunk_m(flight) < 0.4
    assert (hit.ended_at_boot_us - hit.contact_at_boot_us) < 700_000


def test_against_a_wind_it_speeds_up_by_what_that_leaves_of_the_lean():
    # Given a wind of 4 m/s from the north, and a way north at 3 m/s
    ahead = {"go_to": {"position_ned_m": [9, 0, -3], "speed_m_s": 3.0, "yaw_deg": 0}}
    flight = in_room(ahead, wind_ned_m_s=[-4, 0, 0])
    north_m_s = flight.series["velocity_ned_m_s"][:, 0]
    begun = int(np.flatnonzero(flight.series["position_ned_m"][:, 0] > 0.3)[0])
    fast = begun + int(np.flatnonzero(north_m_s[begun:] > 1.8)[0])
    # Then it leans as much as it would without the wind, for longer
    assert flight.tilt_deg[begun:fast].max() < 11.0
    assert flight.report.outcome == "completed"


@pytest.mark.parametrize(("east_m_s", "wide_m"), [(0.0, 8.0), (0.7, 2.0)], ids=["held", "past its end"])
def test_a_velocity_that_a_known_wall_holds_back_does_not_catch_up(east_m_s, wide_m):
    # Given a wall 1.5 m to the north that is known, and an item that leads through it, or along it and past its end
    ends = [[1.5, -wide_m / 2, -3], [1.5, wide_m / 2, -3]]
    known = {"known": [{"touches_ned_m": ends, "normal_ned": [-1, 0, 0]}]}
    item = {"velocity": {"velocity_ned_m_s": [1.0, east_m_s, 0], "duration_s": 7.0}}
    flight = in_room(item, {"hold": {"duration_s": 3}}, obstacles=known, walls=[wall(1.5, width_m=wide_m)])
    # Then neither the way past its end nor the hold after it makes up for what was held back
    north_m, *_ = flight.series["position_ned_m"].T
    speed_m_s = np.hypot(*flight.series["velocity_ned_m_s"][:, :2].T)
    assert flight.report.outcome == "completed" and not flight.hits
    assert speed_m_s.max() < 1.6 and flight.tilt_deg.max() < 20.0
    assert (north_m.max() < 1.3) == (east_m_s == 0.0) and north_m.max() < 4.0


@pytest.mark.parametrize("policy", ["hold", pytest.param("return", marks=pytest.mark.slow)])
def test_a_hit_in_the_descent_is_recovered_from_and_the_landing_goes_on(policy):
    # Given a landing from 2.5 m, when a wall that comes from the north strikes the vehicle, and stops where it did
    comes = {"velocity_ned_m_s": [-1.2, 0, 0], "from_s": 9.9, "until_s": 11.5}
    flight = in_room(height_m=2.5, then=policy, walls=[wall(2.0, motion=comes)])
    hit, collision = flight.hits[0], flight.report.collisions[0]
    assert 0.8 < -hit.contact_position_ned_m[2] < 2.4, "on the way down"
    # Then it is answered at once, away from the gate, and the vehicle lands clear of it, whatever the policy
    assert collision.sample_time_boot_us - hit.contact_at_boot_us < 50_000
    assert collision.recovery_setpoint_ned_m[0] < hit.contact_position_ned_m[0] - 0.3
    assert flight.report.outcome == "completed", flight.report.reason
    assert flight.series["position_ned_m"][-1][0] < hit.contact_position_ned_m[0] - 0.25


@pytest.mark.parametrize("kept_s", [0.02, 0.1, 0.2])
def test_a_brake_of_a_throw_that_nobody_ends_makes_no_fall(kept_s):
    # Given a hit at 5 m/s that throws the vehicle up, braked by up to 8 m/s^2 downwards
    sets = ("items.1.go_to.speed_m_s=5", "items.1.go_to.acceleration_m_s2=4", "companion.flight.speeding_up_m_s2=4")
    flight = simulated("wall", *sets)
    flight.run_until(lambda: "detection" in flight.kinds())
    flight.run_for(kept_s)
    # When that is the last that comes, and PX4 waits for COM_OF_LOSS_T, 1 s
    killed_at_us = flight.vehicle.time_boot_us
    for _ in range(12 * 250):
        flight.vehicle.step(b"")
    velocity = flight.series["velocity_ned_m_s"][flight.series["time_boot_us"] >= killed_at_us]
    # Then its velocity loop ends it at 8 m/s^2 over MPC_Z_VEL_P_ACC, 4 1/s, and what it sank with; not at 5 m/s
    assert velocity[:, 2].max() < 2.8


@pytest.mark.parametrize("lost", ["HIGHRES_IMU", None])
def test_a_tilt_that_no_sample_renews_is_not_repeated(lost):
    # Given a recovery by attitude, in which the IMU's stream ends, or all that the vehicle sends
    flight = simulated([{"takeoff": {"height_m": 1.5}}, FAST, {"land": {}}], sim={"walls": [wall(4.0)]})
    flight.run_to("recovering")
    flight.run_for(0.056)
    lost_us, decoder = flight.now_us, flight.companion._decoder
    decoder._readers = {n: reader for n, reader in decoder._readers.items() if lost not in (None, reader.name)}
    flight.run_for(3.0)
    # Then it rests by position, where it is as it reports, or by the vehicle's own failsafe
    reflex, latest = flight.companion.core.reflex, flight.companion.core.flight.latest
    assert lost is None or reflex.place_ned_m(latest) == pytest.approx(latest.position_ned_m, abs=0.1)
    assert flight.messages("SET_ATTITUDE_TARGET")[-1][0] - lost_us < 150_000
    assert np.abs(flight.series["position_ned_m"][-750:, :2] - [3.7, 0.0]).max() < 1.0
