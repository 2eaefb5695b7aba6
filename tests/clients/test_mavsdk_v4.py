"""MAVSDK for Python, the native binding (version 4), through each of its capabilities and plugins.

Real time, three times as fast: every flight is short.
"""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins import geofence, mission_raw
from mavsdk.plugins import mission as mission_types
from mavsdk.plugins import offboard as offboard_types
from mavsdk.plugins.action import Action, OrbitYawBehavior
from mavsdk.plugins.component_metadata import ComponentMetadata
from mavsdk.plugins.follow_me import Config, FollowMe, TargetLocation
from mavsdk.plugins.ftp import Ftp
from mavsdk.plugins.info import Info
from mavsdk.plugins.mission import Mission
from mavsdk.plugins.param import Param
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
        self.texts: list[str] = []
        self.telemetry.subscribe_status_text(lambda text, _: self.texts.append(text.text.strip()))
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


@contextmanager
def flown(speed: float) -> Iterator[Vehicle]:
    """So many times faster than the clock."""
    with simulator("--speed", str(speed)) as simulated:
        connected = Vehicle(simulated.companion_port)
        yield connected
        connected.mavsdk.destroy()


@pytest.fixture
def vehicle():
    with flown(3) as connected:
        yield connected


TELEMETRY = (
    *("position", "home", "in_air", "landed_state", "armed", "attitude_quaternion", "attitude_euler"),
    *("attitude_angular_velocity_body", "velocity_ned", "gps_info", "raw_gps", "battery", "flight_mode"),
    *("health", "rc_status", "odometry", "position_velocity_ned", "imu", "health_all_ok", "unix_epoch_time"),
    *("scaled_pressure", "heading", "altitude", "vtol_state"),
)


def test_telemetry_of_every_kind_and_who_it_is(vehicle):
    info, told = Info(vehicle.system), {}
    for name in TELEMETRY:
        getattr(vehicle.telemetry, f"subscribe_{name}")(lambda value, _, name=name: told.update({name: value}))
    info.subscribe_flight_information(lambda value, _: told.update(flight=value))
    wait_until(lambda: told.keys() == {*TELEMETRY, "flight"}, 15, "told of everything")
    assert None not in told.values()
    version = info.get_version()
    assert (version.flight_sw_major, version.flight_sw_minor) == (1, 17)
    assert info.get_identification().legacy_uid > 0
    assert info.get_speed_factor() == pytest.approx(3.0, abs=0.9)


def test_all_parameters_and_single_ones(vehicle):
    param = Param(vehicle.system)
    everything = param.get_all_params()
    assert len(everything.int_params) + len(everything.float_params) > 100
    assert param.get_param_int("MAV_SYS_ID") == 1
    param.set_param_float("MPC_XY_CRUISE", 6.0)
    assert param.get_param_float("MPC_XY_CRUISE") == 6.0
    vehicle.action.set_takeoff_altitude(4.0)
    assert vehicle.action.get_takeoff_altitude() == 4.0
    vehicle.action.set_return_to_launch_altitude(12.0)
    assert vehicle.action.get_return_to_launch_altitude() == 12.0


def test_takeoff_go_to_orbit_return_and_land(vehicle):
    vehicle.take_off()
    with pytest.raises(Exception, match="COMMAND_DENIED"):
        vehicle.action.disarm()
    vehicle.action.set_current_speed(4.0)
    (north, east), height_m = vehicle.place, vehicle.telemetry.position().absolute_altitude_m
    vehicle.action.goto_location(north + 9 * METRE_DEG, east, height_m, 0.0)
    wait_until(lambda: vehicle.ned[0] > 7.5, 20, "there")
    vehicle.action.do_orbit(5.0, 2.0, OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER, north, east, height_m)
    # An orbit shows as a kind of position mode
    wait_until(lambda: vehicle.flies(FlightMode.POSCTL), 5, "circling")
    vehicle.action.hold()
    wait_until(lambda: vehicle.flies(FlightMode.HOLD), 5, "holding")
    vehicle.action.return_to_launch()
    wait_until(lambda: vehicle.flies(FlightMode.RETURN_TO_LAUNCH), 5, "returning")
    vehicle.action.land()
    vehicle.wait_for_landing()
    said = {"Armed by external command", "Takeoff detected", "Landing detected", "Disarmed by landing"}
    wait_until(lambda: said <= set(vehicle.texts), 5, "all that was to be said")


def test_offboard_by_position_velocity_body_attitude_and_rates(vehicle):
    offboard, types = offboard_types.Offboard(vehicle.system), offboard_types
    vehicle.take_off()
    with pytest.raises(Exception, match="NO_SETPOINT_SET"):
        offboard.start()
    there, still = types.PositionNedYaw(3.0, 0.0, -3.0, 90.0), types.VelocityNedYaw(0.0, 0.0, 0.0, 90.0)
    offboard.set_position_ned(there)
    offboard.start()
    wait_until(lambda: math.dist(vehicle.ned, (3.0, 0.0, -3.0)) < 0.4, 15, "there")

    def flies_east_at(low_m_s, high_m_s):
        wait_until(lambda: low_m_s < vehicle.telemetry.velocity_ned().east_m_s < high_m_s, 15, "as fast as asked")

    offboard.set_velocity_ned(types.VelocityNedYaw(0.0, 1.0, 0.0, 90.0))
    flies_east_at(0.8, 1.2)
    # The nose points east: forward is east
    offboard.set_velocity_body(types.VelocityBodyYawspeed(-1.0, 0.0, 0.0, 0.0))
    flies_east_at(-1.2, -0.7)
    offboard.set_position_velocity_ned(there, still)
    wait_until(lambda: math.dist(vehicle.ned, (3.0, 0.0, -3.0)) < 0.4, 15, "there again")
    offboard.set_attitude(types.Attitude(0.0, -5.0, 90.0, 0.78))
    wait_until(lambda: vehicle.telemetry.attitude_euler().pitch_deg < -3.0, 15, "leaning")
    offboard.set_attitude_rate(types.AttitudeRate(0.0, 5.0, 0.0, 0.78))
    time.sleep(0.4)
    offboard.set_acceleration_ned(types.AccelerationNed(0.0, 0.0, 0.0))
    time.sleep(0.2)
    offboard.set_velocity_ned(still)
    flies_east_at(-0.2, 0.2)
    offboard.stop()
    wait_until(lambda: vehicle.flies(FlightMode.HOLD), 5, "holding")
    vehicle.action.land()
    vehicle.wait_for_landing()


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
