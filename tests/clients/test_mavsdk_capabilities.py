"""MAVSDK's plugins one by one, each to the end that its example has on a PX4."""

import math
import time

import pytest
from mavsdk.plugins import mission as mission_types
from mavsdk.plugins.component_metadata import ComponentMetadata
from mavsdk.plugins.follow_me import Config, FollowMe, TargetLocation
from mavsdk.plugins.ftp import Ftp
from mavsdk.plugins.mission import Mission
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import FlightMode
from mavsdk_vehicle import METRE_DEG, flown
from simulator import wait_until


def test_a_mission_that_returns_counts_to_its_end_and_lands_at_home():
    with flown(3) as vehicle:
        north, east = vehicle.place
        vehicle.action.set_return_to_launch_altitude(6.0)
        items = []
        for place_m in (10.0, 20.0):
            item = mission_types.MissionItem()
            item.latitude_deg, item.longitude_deg = north + place_m * METRE_DEG, east
            item.relative_altitude_m, item.speed_m_s, item.is_fly_through = 4.0, 4.0, True
            items.append(item)
        mission = Mission(vehicle.system)
        mission.set_return_to_launch_after_mission(True)
        mission.upload_mission(mission_types.MissionPlan(items))
        assert mission.get_return_to_launch_after_mission()
        vehicle.action.arm()
        mission.start_mission()
        wait_until(lambda: mission.mission_progress().current == 2, 40, "both places")
        assert mission.is_mission_finished()
        wait_until(lambda: vehicle.flies(FlightMode.RETURN_TO_LAUNCH), 5, "returning")
        vehicle.wait_for_landing()
        assert math.hypot(*vehicle.ned[:2]) < 0.5


def test_follow_me_keeps_its_distance_from_a_target_that_walks():
    # In real time: MAVSDK tells of the target once a second
    with flown(1) as vehicle:
        north, east = vehicle.place
        height_m = vehicle.telemetry.position().absolute_altitude_m
        vehicle.take_off()
        follow = FollowMe(vehicle.system)
        follow.set_config(Config(8.0, 6.0, 0.1, Config.FollowAltitudeMode.CONSTANT, 4.0, 180.0))
        assert follow.get_config().follow_distance_m == 6.0
        assert Param(vehicle.system).get_param_float("FLW_TGT_DST") == 6.0
        follow.start()
        wait_until(lambda: vehicle.flies(FlightMode.FOLLOW_ME), 5, "following")
        begun_s = time.monotonic()
        while (elapsed_s := time.monotonic() - begun_s) < 14.0:
            # Two metres a second to the north, from ten metres away
            here = north + (10.0 + 2.0 * elapsed_s) * METRE_DEG
            follow.set_target_location(TargetLocation(here, east, height_m, 2.0, 0.0, 0.0))
            time.sleep(0.5)
        behind_m = 10.0 + 2.0 * elapsed_s - vehicle.ned[0]
        assert behind_m == pytest.approx(6.0, abs=3.0)
        assert -vehicle.ned[2] == pytest.approx(8.0, abs=1.0)
        follow.stop()
        wait_until(lambda: vehicle.flies(FlightMode.HOLD), 5, "holding")


def test_files_and_descriptions_that_there_are_not_are_refused_at_once():
    with flown(1) as vehicle:
        begun_s = time.monotonic()
        files = Ftp(vehicle.system)
        listed = files.list_directory("/")
        assert listed.entries == []
        with pytest.raises(Exception, match="FILE_DOES_NOT_EXIST"):
            files.remove_file("/etc/extras/component_general.json.xz")
        metadata, told = ComponentMetadata(vehicle.system), []
        metadata.subscribe_metadata_available(lambda data, _: told.append(data))
        metadata.request_autopilot_component()
        time.sleep(2.0)
        assert told == []
        assert time.monotonic() - begun_s < 6.0
        # And nothing is held up by it
        assert Param(vehicle.system).get_param_float("MIS_TAKEOFF_ALT") == 2.5
