"""One packet alone is answered at once and counts for nothing: a second row confirms a hit within 150 ms."""

import functools
import math
from collections.abc import Callable

import pytest

from bench.fly.copies import in_a_copy
from bench.fly.packets import made
from tests.flying import Flight
from tests.simulated import simulated

pytestmark = pytest.mark.flight

PATH = {"path": {"points_ned_m": [[2, 0, -1.5], [6, 0, -1.5]], "speed_m_s": 2.0}}
ITEMS = [{"takeoff": {"height_m": 1.5}}, PATH, {"land": {}}]


def imu(air: Flight, force_m_s2: float, rate_rad_s: float = 0.0) -> bytes:
    """Between two of the vehicle's own samples: a push against the way, or a turn about the nose."""
    when = {"time_usec": air.vehicle.time_boot_us + 2000, "fields_updated": 0x3F}
    return made("HIGHRES_IMU", {**when, "xacc": force_m_s2, "zacc": -9.8, "xgyro": rate_rad_s})


def motion(air: Flight) -> tuple[float, ...]:
    latest = air.companion.core.flight.vehicle.history.latest
    return (*latest.position_ned_m, *latest.velocity_ned_m_s)


def moved(air: Flight, *jump: float) -> dict[str, float]:
    pairs = zip(("x", "y", "z", "vx", "vy", "vz"), motion(air), jump, strict=True)
    return {name: was + by for name, was, by in pairs}


def local_position(air: Flight, *jump: float) -> bytes:
    stamp = {"time_boot_ms": (air.vehicle.time_boot_us + 2000) // 1000}
    return made("LOCAL_POSITION_NED", stamp | moved(air, *jump))


def odometry(air: Flight, *jump: float) -> bytes:
    """With the reset counter of a vehicle that has never reset its estimate."""
    frames = {"time_usec": air.vehicle.time_boot_us + 2000, "frame_id": 1, "child_frame_id": 1, "q": [1, 0, 0, 0]}
    return made("ODOMETRY", frames | moved(air, *jump))


@functools.cache
def cruising(*sets: str) -> Flight:
    """Flown once, and looked at in children alone."""
    keys = {"on_collision": {"then": "continue", "max_hits": 2}, "companion": {"streams": {"window_s": 0.5}}}
    air = simulated([ITEMS[0], {"expect": {"no_collision": {}}}, *ITEMS[1:]], *sets, **keys)
    air.run_until(lambda: air.state == "mission" and (air.companion.status().position_ned_m or (0,))[0] > 2.5)
    return air


def fly_on(work: Callable[[Flight], None], *sets: str) -> None:
    """What the test does with a vehicle in the middle of its cruise."""
    air = cruising(*sets)
    found = in_a_copy(lambda: work(air))
    assert found is None, found["error"]


def assert_goes_on(air: Flight, unconfirmed: int) -> None:
    """To the item's goal, as if nothing had been there."""
    air.run_to("landing", 4.5)
    assert motion(air)[0] == pytest.approx(6.0, abs=0.3)
    assert (air.report.collisions, air.report.unconfirmed, air.report.obstacles) == ((), unconfirmed, ())
    assert air.told("expect") == []


@pytest.mark.parametrize("force_m_s2", [-100.0, -10.0, -8.0, 40.0])
def test_one_forged_packet_costs_a_twitch(force_m_s2):
    def forge(air: Flight) -> None:
        before_us = air.now_us
        air.step(imu(air, force_m_s2))
        # The companion acts on it at once
        assert air.state == "recovering"
        here = air.companion.status().position_ned_m
        # And within a quarter of a second the mission goes on
        assert air.run_until(lambda: air.state != "recovering", 1.0) <= 0.25
        assert air.state == "mission" and air.kinds().count("unconfirmed") == 1
        for _, message in air.setpoints_since(before_us):
            assert message.type_mask & 0x003 or math.dist((message.x, message.y, message.z), here) <= 5.0
            assert message.type_mask & 0x1C0 or math.hypot(message.afx, message.afy) <= 9.81
        assert_goes_on(air, unconfirmed=1)

    fly_on(forge)


def test_a_climb_and_what_is_flown_for_a_time_or_round_go_on_where_they_were():
    around = {"orbit": {"centre_ned_m": [3, 2, -1.5], "radius_m": 2, "turns": 0.5, "yaw_deg": None}}
    ahead = {"velocity": {"velocity_ned_m_s": [1, 0, 0], "duration_s": 4}}
    air = simulated([ITEMS[0], {"hold": {"duration_s": 4}}, ahead, around, {"land": {}}])
    air.run_until(lambda: "armed" in air.kinds() and motion(air)[2] < -0.9)
    air.step(imu(air, -100.0))
    air.run_to("mission")
    for number in (1, 2, 3):
        air.run_until(lambda told=2 * number: air.kinds().count("item") == told, 2.5)
        assert motion(air)[2] == pytest.approx(-1.5, abs=0.2)
        air.run_for(2.5)
        air.step(imu(air, -100.0))
        air.run_until(lambda: air.state == "mission", 1.0)
    assert air.run_to("landing") <= 6.5, "half a circle takes 7.7 s"


@pytest.mark.parametrize("hz", [250, 50])
@pytest.mark.parametrize("jump", [(0, 0, 0, -2, 0, 0), (0, 0, 0, 0, 2, 0)], ids=["brakes", "slides"])
def test_one_forged_velocity_is_contradicted_by_the_velocities_after_it(jump, hz):
    def forge(air: Flight) -> None:
        air.step(odometry(air, *jump))
        until_s = air.run_to("recovering", 0.1)
        assert until_s + air.run_to("mission", 1.0) <= 0.25
        # What was none hides nothing of a velocity
        air.run_until(lambda: air.events[-1].text == "velocity valid again", 0.1)
        assert_goes_on(air, unconfirmed=1)

    fly_on(forge, f"companion.streams.highres_imu_hz={hz}")


@pytest.mark.parametrize("hz", [250, 50])
@pytest.mark.parametrize(
    "forged",
    [
        lambda air: imu(air, 0.0, rate_rad_s=10.0),
        lambda air: imu(air, 0.0, rate_rad_s=30.0),
        lambda air: local_position(air, 0, -5, 0, 0, 0, 0),
        lambda air: local_position(air, 0, 0, 5, 0, 0, 0),
        lambda air: local_position(air, 0, 0, 0, -2, 0, 0),
    ],
    ids=["slow turn", "fast turn", "aside", "down", "brakes"],
)
def test_one_forged_rate_place_or_velocity_of_local_position_is_no_hit(forged, hz):
    def forge(air: Flight) -> None:
        air.step(forged(air))
        assert_goes_on(air, unconfirmed=0)

    fly_on(forge, f"companion.streams.highres_imu_hz={hz}")
