"""MAVSDK for Python, the native binding (version 4), through each of its capabilities."""

import asyncio
import math
from collections.abc import AsyncGenerator, Awaitable, Callable

import mavsdk.asyncio.plugins.offboard as offboard_types
import mavsdk.plugins.action as action_types
import pytest
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, System
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.info import InfoAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from simulator import simulator

# FlightMode's numbers; an orbit shows as a kind of position mode.
HOLD, RETURN, POSITION = 3, 5, 11


def flown(scenario: Callable[[System], Awaitable[None]], seconds: float = 120.0) -> None:
    """Run the scenario on a vehicle of its own."""

    async def main() -> None:
        with simulator() as simulated:
            configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
            async with Mavsdk(configuration) as mavsdk:
                await mavsdk.add_any_connection(f"udpin://127.0.0.1:{simulated.companion_port}")
                system = await mavsdk.first_autopilot(timeout_s=15.0)
                assert system is not None
                await asyncio.wait_for(scenario(system), seconds)

    asyncio.run(main())


async def first(stream: AsyncGenerator, condition: Callable = lambda value: True, seconds: float = 15.0):
    """The first value for which the condition holds."""

    async def find():
        async for value in stream:
            if condition(value):
                return value
        raise AssertionError("the stream ended")

    return await asyncio.wait_for(find(), seconds)


async def take_off(system: System) -> None:
    action, telemetry = ActionAsync(system), TelemetryAsync(system)
    await first(telemetry.subscribe_health_all_ok(), bool)
    await action.arm()
    await action.takeoff()
    await first(telemetry.subscribe_in_air(), bool)
    await first(telemetry.subscribe_flight_mode(), lambda mode: int(mode) == HOLD)


async def land(system: System) -> None:
    await ActionAsync(system).land()
    await first(TelemetryAsync(system).subscribe_armed(), lambda armed: not armed, 40.0)


def test_telemetry_of_every_kind_and_who_it_is():
    async def scenario(system: System) -> None:
        telemetry, info = TelemetryAsync(system), InfoAsync(system)
        for name in (
            *("position", "home", "in_air", "landed_state", "armed", "attitude_quaternion", "attitude_euler"),
            *("attitude_angular_velocity_body", "velocity_ned", "gps_info", "raw_gps", "battery", "flight_mode"),
            *("health", "rc_status", "odometry", "position_velocity_ned", "imu", "health_all_ok", "unix_epoch_time"),
            *("scaled_pressure", "heading", "altitude", "vtol_state"),
        ):
            assert await first(getattr(telemetry, f"subscribe_{name}")()) is not None, name
        version = await info.get_version()
        assert (version.flight_sw_major, version.flight_sw_minor) == (1, 17)
        assert (await info.get_identification()).legacy_uid > 0
        assert await info.get_speed_factor() == pytest.approx(1.0, abs=0.3)
        assert await first(info.subscribe_flight_information()) is not None

    flown(scenario)


def test_all_parameters_and_single_ones():
    async def scenario(system: System) -> None:
        param, action = ParamAsync(system), ActionAsync(system)
        everything = await param.get_all_params()
        assert len(everything.int_params) + len(everything.float_params) > 100
        assert await param.get_param_int("MAV_SYS_ID") == 1
        await param.set_param_float("MPC_XY_CRUISE", 6.0)
        assert await param.get_param_float("MPC_XY_CRUISE") == 6.0
        await action.set_takeoff_altitude(4.0)
        assert await action.get_takeoff_altitude() == 4.0
        await action.set_return_to_launch_altitude(12.0)
        assert await action.get_return_to_launch_altitude() == 12.0

    flown(scenario)


def test_takeoff_go_to_orbit_return_and_land():
    async def scenario(system: System) -> None:
        action, telemetry = ActionAsync(system), TelemetryAsync(system)
        texts: list[str] = []

        async def listen() -> None:
            async for text in telemetry.subscribe_status_text():
                texts.append(text.text.strip())

        listener = asyncio.create_task(listen())
        await take_off(system)
        with pytest.raises(Exception, match="COMMAND_DENIED"):
            await action.disarm()
        await action.set_current_speed(4.0)
        start = await first(telemetry.subscribe_position())
        await action.goto_location(start.latitude_deg + 8e-5, start.longitude_deg, start.absolute_altitude_m, 0.0)
        north_deg = start.latitude_deg + 7e-5
        await first(telemetry.subscribe_position(), lambda place: place.latitude_deg > north_deg, 20.0)
        behaviour = action_types.OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
        here = (start.latitude_deg, start.longitude_deg, start.absolute_altitude_m)
        await action.do_orbit(5.0, 2.0, behaviour, *here)
        await first(telemetry.subscribe_flight_mode(), lambda mode: int(mode) == POSITION)
        await action.hold()
        await first(telemetry.subscribe_flight_mode(), lambda mode: int(mode) == HOLD)
        await action.return_to_launch()
        await first(telemetry.subscribe_flight_mode(), lambda mode: int(mode) == RETURN)
        await land(system)
        listener.cancel()
        assert {"Armed by external command", "Takeoff detected", "Landing detected", "Disarmed by landing"} <= set(
            texts
        )

    flown(scenario)


def test_offboard_by_position_velocity_body_attitude_and_rates():
    async def scenario(system: System) -> None:
        offboard, telemetry = OffboardAsync(system), TelemetryAsync(system)
        types = offboard_types
        await take_off(system)
        with pytest.raises(Exception, match="NO_SETPOINT_SET"):
            await offboard.start()
        await offboard.set_position_ned(types.PositionNedYaw(3.0, 0.0, -3.0, 90.0))
        await offboard.start()
        arrived = await first(
            telemetry.subscribe_position_velocity_ned(),
            lambda seen: math.dist((seen.position.north_m, seen.position.down_m), (3.0, -3.0)) < 0.4,
        )
        assert arrived is not None
        await offboard.set_velocity_ned(types.VelocityNedYaw(0.0, 1.0, 0.0, 90.0))
        await first(telemetry.subscribe_velocity_ned(), lambda seen: seen.east_m_s > 0.8)
        # The nose points east: forward is east
        await offboard.set_velocity_body(types.VelocityBodyYawspeed(-1.0, 0.0, 0.0, 0.0))
        await first(telemetry.subscribe_velocity_ned(), lambda seen: seen.east_m_s < -0.7)
        await offboard.set_position_velocity_ned(
            types.PositionNedYaw(3.0, 0.0, -3.0, 90.0), types.VelocityNedYaw(0.0, 0.0, 0.0, 90.0)
        )
        await asyncio.sleep(3.0)
        await offboard.set_attitude(types.Attitude(0.0, -5.0, 90.0, 0.78))
        await first(telemetry.subscribe_attitude_euler(), lambda seen: seen.pitch_deg < -3.0)
        await offboard.set_attitude_rate(types.AttitudeRate(0.0, 5.0, 0.0, 0.78))
        await asyncio.sleep(1.0)
        await offboard.set_acceleration_ned(types.AccelerationNed(0.0, 0.0, 0.0))
        await asyncio.sleep(0.5)
        await offboard.set_velocity_ned(types.VelocityNedYaw(0.0, 0.0, 0.0, 90.0))
        await asyncio.sleep(2.0)
        await offboard.stop()
        await first(telemetry.subscribe_flight_mode(), lambda mode: int(mode) == HOLD)
        await land(system)

    flown(scenario)
