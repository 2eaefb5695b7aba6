"""The guard attached to MAVSDK 4, in real time: what reaches the vehicle, and who flies it afterwards."""

import asyncio
import math
import re
import subprocess
import sys
from pathlib import Path

import pytest
from mavsdk import ComponentType, Configuration
from mavsdk import asyncio as asynchronous
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from simulator import ROOT, Simulator, simulator
from test_mavsdk_v4 import flown

from companion.mavsdk import CollisionGuard, GuardConfig, GuardError, State

WALL = ("--mission", str(ROOT / "missions" / "wall.yaml"), "--set", "sim.walls.0.height_m=20")


def test_from_a_mode_of_px4s_own_offboard_is_confirmed_and_given_back_and_asyncio_hears_of_it():
    async def main(simulated: Simulator) -> list[str]:
        kinds: list[str] = []
        configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        async with asynchronous.Mavsdk(configuration) as mavsdk:
            await mavsdk.add_any_connection(f"udpin://127.0.0.1:{simulated.companion_port}")
            system = await mavsdk.first_autopilot(timeout_s=15.0)
            async with CollisionGuard(mavsdk, system, GuardConfig(then="previous")) as guard:

                async def listen() -> None:
                    async for event in guard.watch_events():
                        kinds.append(event.kind)

                listener = asyncio.create_task(listen())
                action, telemetry = ActionAsync(system), TelemetryAsync(system)
                async for healthy in telemetry.subscribe_health_all_ok():
                    if healthy:
                        break
                await action.arm()
                await action.takeoff()
                while guard.state is not State.WATCHING:
                    await asyncio.sleep(0.1)
                await asyncio.sleep(5.0)
                start = await anext(telemetry.subscribe_position())
                north_deg = start.latitude_deg + math.degrees(8.0 / 6_371_000.0)
                await action.goto_location(north_deg, start.longitude_deg, start.absolute_altitude_m, 0.0)
                async with asyncio.timeout(30.0):
                    while "given_back" not in kinds:
                        await asyncio.sleep(0.1)
                confirmed_ms = next(event for event in guard.events if event.kind == "confirmed").data["after_ms"]
                assert confirmed_ms < 1e3 * GuardConfig().confirm_within_s
                listener.cancel()
        return kinds

    with simulator(*WALL) as simulated:
        kinds = asyncio.run(main(simulated))
    order = [kind for kind in kinds if kind in ("take_over", "confirmed", "recovered", "given_back")]
    assert order[:4] == ["take_over", "confirmed", "recovered", "given_back"]


def test_the_three_lines_of_the_document_are_enough():
    text = (ROOT / "docs" / "tutorials" / "mavsdk.md").read_text()
    lines = re.search(r"<!-- three lines -->\n```python\n(.*?)```", text, re.DOTALL)[1]
    assert len([line for line in lines.splitlines() if line]) == 3
    with flown(3) as vehicle:
        names = {"mavsdk": vehicle.mavsdk, "system": vehicle.system}
        exec(lines, names)
        guard = names["guard"]
        vehicle.take_off()
        assert guard.state is State.WATCHING
        # Whichever end comes first.
        vehicle.mavsdk.destroy()
        guard.stop()


def test_the_example_flies_into_the_wall_and_lands():
    with simulator(*WALL) as simulated:
        command = [sys.executable, str(ROOT / "examples" / "guarded_offboard.py")]
        command.append(f"udpin://127.0.0.1:{simulated.companion_port}")
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=120, cwd=ROOT, env={"PYTHONPATH": str(ROOT)}
        )
    assert done.returncode == 0, done.stderr
    assert "taking over from OFFBOARD" in done.stdout
    assert "given back to AUTO.LOITER" in done.stdout
    assert "program: flew into something at 1." in done.stdout


def test_what_is_no_mavsdk_is_said_in_a_sentence():
    with pytest.raises(GuardError, match="wants MAVSDK's Mavsdk object"):
        CollisionGuard(Path("/"), object())
