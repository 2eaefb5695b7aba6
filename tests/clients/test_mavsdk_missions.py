"""MAVSDK's plugins for raw missions, fences and sticks, in flight.

Real time, three times as fast: every flight is short.
"""

import math
import time

import pytest
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins import geofence, mission_raw
from mavsdk.plugins.action import Action
from mavsdk.plugins.manual_control import ManualControl
from mavsdk.plugins.telemetry import FlightMode, Telemetry
from simulator import simulator, wait_until

METRE_DEG = 1.0 / 111_320.0


class Vehicle:
    """Connected, healthy, on the ground."""

    def __init__(self, port: int) -> None:
        self.mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
        self.mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        self.system = self.mavsdk.first_autopilot(30.0)
        assert self.system is not None
        self.action, self.telemetry = Action(self.system), Telemetry(self.system)
        wait_until(self.telemetry.health_all_ok, 30, "healthy")

    @property
    def place(self) -> tuple[float, float]:
        position = self.telemetry.position()
        return position.latitude_deg, position.longitude_deg

    @property
    def ned(self) -> tuple[float, float, float]:
        position = self.telemetry.position_velocity_ned().position
        return position.north_m, position.east_m, position.down_m

    def take_off(self, height_m: float = 3.0) -> None:
        self.action.set_takeoff_altitude(height_m)
        self.action.arm()
        self.action.takeoff()
        wait_until(lambda: -self.ned[2] > height_m - 0.8 and self.flies(FlightMode.HOLD), 30, "taken off")

    def flies(self, mode: FlightMode) -> bool:
        return self.telemetry.flight_mode() == mode

    def wait_for_landing(self) -> None:
        wait_until(lambda: not self.telemetry.armed(), 60, "landed and disarmed")


@pytest.fixture
def vehicle():
    with simulator("--speed", "3") as simulated:
        connected = Vehicle(simulated.companion_port)
        yield connected
        connected.mavsdk.destroy()


def test_a_mission_is_uploaded_flown_paused_resumed_and_ends_on_the_ground(vehicle):
    north, east = vehicle.place
    raw = mission_raw.MissionRaw(vehicle.system)

    def item(number, command, north_m, height_m, hold_s=0.0):
        place = round((north + north_m * METRE_DEG) * 1e7), round(east * 1e7)
        first = 1 if number == 0 else 0
        return mission_raw.MissionItem(number, 6, command, first, 1, hold_s, 0, 0, math.nan, *place, height_m, 0)

    items = [item(0, 22, 0, 4), item(1, 16, 12, 4, 1.0), item(2, 16, 6, 4), item(3, 21, 6, 0)]
    raw.upload_mission(items)
    assert [(there.command, there.x, there.z) for there in raw.download_mission()] == [
        (there.command, there.x, there.z) for there in items
    ]
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


def test_sticks_fly_it_in_position_mode(vehicle):
    vehicle.take_off()
    sticks = ManualControl(vehicle.system)

    def hold(seconds, pitch=0.0, climb=0.5):
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            sticks.set_manual_control_input(pitch, 0.0, climb, 0.0)
            time.sleep(0.02)

    hold(0.5)
    sticks.start_position_control()
    hold(1.0)
    assert vehicle.flies(FlightMode.POSCTL)
    before = vehicle.ned
    hold(1.5, pitch=0.6)
    assert vehicle.ned[0] > before[0] + 2.0
    hold(1.0, climb=0.9)
    assert vehicle.ned[2] < before[2] - 0.5
