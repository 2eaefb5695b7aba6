"""MAVSDK for Python over gRPC (version 3), which cannot share an environment with version 4."""

import asyncio

import pytest
from mavsdk import System
from mavsdk.offboard import OffboardError, PositionNedYaw, VelocityBodyYawspeed
from simulator import free_port, guarded_simulator, simulator


async def first(stream, condition=lambda value: True, seconds: float = 20.0):
    async def find():
        async for value in stream:
            if condition(value):
                return value
        raise AssertionError("the stream ended")

    return await asyncio.wait_for(find(), seconds)


async def connected(port: int) -> System:
    drone = System(port=free_port())
    await drone.connect(system_address=f"udpin://127.0.0.1:{port}")
    await first(drone.core.connection_state(), lambda state: state.is_connected)
    await first(drone.telemetry.health(), lambda health: health.is_global_position_ok and health.is_home_position_ok)
    return drone


@pytest.mark.parametrize("vehicle", [simulator, guarded_simulator])
def test_takeoff_offboard_and_land(vehicle):
    async def scenario(port: int) -> None:
        drone = await connected(port)
        await drone.action.arm()
        await drone.action.takeoff()
        await first(drone.telemetry.in_air(), lambda flies: flies)
        await asyncio.sleep(6)
        with pytest.raises(OffboardError):
            await drone.offboard.start()
        await drone.offboard.set_position_ned(PositionNedYaw(2.0, 0.0, -2.5, 0.0))
        await drone.offboard.start()
        await first(drone.telemetry.position_velocity_ned(), lambda seen: abs(seen.position.north_m - 2.0) < 0.3)
        await drone.offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 1.0, 0.0, 0.0))
        await first(drone.telemetry.position_velocity_ned(), lambda seen: seen.velocity.east_m_s > 0.7)
        await drone.offboard.stop()
        await drone.action.land()
        await first(drone.telemetry.armed(), lambda armed: not armed, 40.0)

    with vehicle() as simulated:
        asyncio.run(scenario(simulated.companion_port))
