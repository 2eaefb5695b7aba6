"""MAVSDK's plugins for raw missions and fences, in flight.

Real time, three times as fast: every flight is short.
"""

import math
import time

import pytest
from mavsdk.plugins import geofence, mission_raw
from mavsdk.plugins.telemetry import FlightMode
from mavsdk_vehicle import METRE_DEG, flown
from simulator import wait_until


@pytest.fixture
def vehicle():
    with flown(3) as connected:
        yield connected


def test_a_mission_is_uploaded_flown_paused_resumed_and_ends_on_the_ground(vehicle):
    north, east = vehicle.place
    raw = mission_raw.MissionRaw(vehicle.system)

    def item(number, command, north_m, height_m, hold_s=0.0, kind=0):
        place = round((north + north_m * METRE_DEG) * 1e7), round(east * 1e7)
        first = 1 if number == 0 else 0
        return mission_raw.MissionItem(number, 6, command, first, 1, hold_s, 0, 0, math.nan, *place, height_m, kind)

    items = [item(0, 22, 0, 4), item(1, 16, 12, 4, 1.0), item(2, 16, 6, 4), item(3, 21, 6, 0)]
    raw.upload_mission(items)
    assert [(there.command, there.x, there.z) for there in raw.download_mission()] == [
        (there.command, there.x, there.z) for there in items
    ]
    raw.upload_rally_points([item(0, 5100, 0, 0, kind=2)])
    assert [item.command for item in raw.download_rallypoints()] == [5100]
    vehicle.action.arm()
    raw.start_mission()
    wait_until(lambda: raw.mission_progress().current >= 1, 30, "the first place")
    raw.pause_mission()
    wait_until(lambda: vehicle.flies(FlightMode.HOLD), 5, "paused")
    raw.start_mission()
    wait_until(raw.is_mission_finished, 60, "finished")
    vehicle.wait_for_landing()
    assert vehicle.ned[0] == pytest.approx(6.0, abs=0.6)
    raw.clear_mission()
    assert raw.download_mission() == []


def test_a_fence_is_kept_and_places_beyond_it_are_refused(vehicle):
    north, east = vehicle.place
    corners = [(-15, -15), (-15, 15), (15, 15), (15, -15)]
    points = [geofence.Point(north + n * METRE_DEG, east + e * METRE_DEG) for n, e in corners]
    fence = geofence.Geofence(vehicle.system)
    fence.upload_geofence(geofence.GeofenceData([geofence.Polygon(points, geofence.FenceType.INCLUSION)], []))
    vehicle.take_off()
    height_m = vehicle.telemetry.position().absolute_altitude_m
    vehicle.action.goto_location(north + 40 * METRE_DEG, east, height_m, math.nan)
    time.sleep(1.5)
    assert vehicle.ned[0] < 2.0
    fence.clear_geofence()
    vehicle.action.goto_location(north + 5 * METRE_DEG, east, height_m, math.nan)
    wait_until(lambda: vehicle.ned[0] > 4.0, 20, "a place that no fence forbids")
