"""Drawn vehicles and missions follow from their seed alone, are files, and can be built and flown."""

import pytest
import yaml

from bench.cases.missions import MissionCase, airframe_of, random_mission
from bench.cases.vehicles import AIRFRAMES, drawn_vehicle
from companion.mission.config import CompanionConfig
from companion.mission.model import Mission
from sim_vehicle.airframe import Airframe, with_base

SEEDS = range(1, 61)


@pytest.fixture(scope="module")
def drawn():
    return {kind: [drawn_vehicle(seed, kind) for seed in SEEDS] for kind in AIRFRAMES}


def test_a_vehicle_is_an_airframe_file_that_reads_back_the_same(drawn):
    for data in (*drawn["foldable"], *drawn["rigid"]):
        assert yaml.safe_load(yaml.safe_dump(data)) == data
        Airframe.model_validate(with_base(data))
    assert drawn_vehicle(7, "rigid") == drawn["rigid"][6]
    assert len({yaml.safe_dump(data) for data in drawn["rigid"]}) == len(SEEDS)


def test_a_mission_with_a_drawn_vehicle_says_of_it_what_its_owner_can_measure():
    case = MissionCase(9, "foldable", is_drawn=True)
    vehicle, settings = airframe_of(case), random_mission(case).data["companion"]
    config = CompanionConfig.model_validate(settings).estimate
    assert config.guards.centre_m == pytest.approx(vehicle.geometry.motor_radius_m)
    assert config.guards.radius_m == pytest.approx(vehicle.geometry.guard_radius_m)
    assert config.accelerometer_range_m_s2 == vehicle.imu.accelerometer_range_m_s2
    # The room and the mission are those of the named vehicle
    named = random_mission(MissionCase(9, "foldable")).data
    assert {**named, "companion": 0} == {**random_mission(case).data, "companion": 0}


def test_a_mission_is_a_file_that_reads_back_the_same_and_another_seed_is_another_mission():
    missions = [random_mission(MissionCase(seed, "foldable")) for seed in SEEDS]
    assert random_mission(MissionCase(7, "foldable")) == missions[6]
    assert len({yaml.safe_dump(mission.data) for mission in missions}) == len(SEEDS)
    for mission in missions:
        read = yaml.safe_load(yaml.safe_dump(mission.data))
        assert read == mission.data and Mission.model_validate(read)
