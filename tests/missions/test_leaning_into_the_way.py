"""A vehicle that leans into its way tips over where it hits: how it speeds up, and how fast it takes off."""

import numpy as np
import pytest

from bench.cases.missions import MissionCase
from bench.rows.crashes import tilts_deg
from bench.rows.judge import work_out_mission
from companion.mission.model import Mission
from rebound_cli.inputs import SimulatedWorld, with_guards
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.simulation.lockstep import fly_mission_lockstep
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene

pytestmark = pytest.mark.flight

WALL = {"walls": [{"name": "wall", "point_ned_m": [1.18, 0, -2], "normal_ned": [-1, 0, 0], "height_m": 8}]}
FAST = {"go_to": {"position_ned_m": [9, 0, -3], "speed_m_s": 4.0, "acceleration_m_s2": 3.0, "yaw_deg": 0}}


def flown(folder, *items, **sim):
    data = {
        "name": "lean",
        "items": [{"takeoff": {"height_m": 3}}, *items, {"land": {}}],
        "on_collision": {"then": "land"},
        "fence": {"radius_m": 12, "max_height_m": 6},
    }
    world = SimulatedWorld(Scene.model_validate({**sim, "seed": 1}), load_built_in("foldable"))
    mission = Mission.model_validate(with_guards(data, world.airframe))
    recorder = FlightRecorder(folder)
    flight, _ = fly_mission_lockstep(mission, world, recorder, Interrupts())
    recorder.close()
    return flight


def test_a_wall_met_while_speeding_up_does_not_tip_the_vehicle_over(tmp_path):
    # Given a wall a metre ahead, and an item that allows for 3 m/s^2, with which the vehicle would lean by 21 degrees
    flight = flown(tmp_path, FAST, **WALL)
    series, hit = flight.truth.series, flight.truth.hits[0]
    at = int(np.searchsorted(series["time_boot_us"], hit.contact_at_boot_us)) - 1
    tilt_deg = tilts_deg(series["attitude_wxyz"])
    # Then it meets the wall while it speeds up, nearly level, and stays so
    assert hit.impact_velocity_ned_m_s[0] > 1.0
    assert tilt_deg[at] < 11.0
    assert tilt_deg.max() < 35.0
    assert series["position_ned_m"][at : at + 500, 2].max() - series["position_ned_m"][at, 2] < 0.1


def test_the_take_off_is_no_faster_than_asked(tmp_path):
    flight = flown(tmp_path)
    climb_m_s = -flight.truth.series["velocity_ned_m_s"][:, 2]
    assert climb_m_s.max() < 1.3, "companion.flight.takeoff_speed_m_s is 1.0"


# Slanted, met while the vehicle climbs beside it at 2.6 m/s: what clipping hides leaves its velocity wrong for half a
# second.
SLANTED = {
    "walls": [{"name": "wall", "point_ned_m": [-2.716, -1.101, -3], "normal_ned": [0.959, 0.283, 0], "width_m": 5}],
    "wind_ned_m_s": [1.439, -0.038, 0],
    "start": {"yaw_deg": 98},
}


def test_a_vehicle_that_hangs_on_a_wall_is_let_go_of(tmp_path):
    start = {"go_to": {"position_ned_m": [0.524, -0.208, -1.433], "speed_m_s": 2}}
    into = {"go_to": {"position_ned_m": [-4.661, 0.131, -2.515], "speed_m_s": 2.777, "acceleration_m_s2": 2.266}}
    # Given a vehicle that a hit has turned towards the wall until it hangs on it
    flight = flown(tmp_path, start, into, **SLANTED)
    series, hit = flight.truth.series, flight.truth.hits[0]
    at = int(np.searchsorted(series["time_boot_us"], hit.contact_at_boot_us)) - 1
    tilt_deg = tilts_deg(series["attitude_wxyz"])
    assert hit.impact_velocity_ned_m_s[0] < -2.3
    assert tilt_deg[at : at + 50].max() > 20.0
    # Then it is off it before its own thrust tips it over, with next to no height lost
    assert tilt_deg.max() < 40.0
    assert (hit.ended_at_boot_us - hit.contact_at_boot_us) < 700_000
    assert series["position_ned_m"][at : at + 500, 2].max() - series["position_ned_m"][at, 2] < 0.4


def test_against_a_wind_it_speeds_up_by_what_that_leaves_of_the_lean(tmp_path):
    # Given a wind of 4 m/s from the north, and a way north at 3 m/s
    ahead = {"go_to": {"position_ned_m": [9, 0, -3], "speed_m_s": 3.0, "yaw_deg": 0}}
    flight = flown(tmp_path, ahead, wind_ned_m_s=[-4, 0, 0])
    series = flight.truth.series
    north_m_s = series["velocity_ned_m_s"][:, 0]
    begun = int(np.flatnonzero(series["position_ned_m"][:, 0] > 0.3)[0])
    fast = begun + int(np.flatnonzero(north_m_s[begun:] > 1.8)[0])
    # Then it leans as much as it would without the wind, for longer
    assert tilts_deg(series["attitude_wxyz"])[begun:fast].max() < 11.0
    assert flight.report.outcome == "completed"


@pytest.mark.slow
def test_a_pole_that_spins_a_rigid_vehicle_is_not_braked_as_a_throw():
    # Given a random mission in which a pole meets one guard at 1.5 m/s and a lean of 15 degrees
    hit = work_out_mission(MissionCase(seed=11905, airframe="rigid", feed_forward=True))["hits"][0]
    assert hit["kind"] == "pole" and 1.3 < hit["speed_m_s"] < 1.6
    # Then the height stays: taken for a throw of 0.8 m/s, the spin would be braked into a fall of 0.36 m
    assert hit["lost_m"] < 0.1 and hit["risen_m"] < 0.1
