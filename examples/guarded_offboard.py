"""A program of one's own on MAVSDK that flies north by OFFBOARD, with the guard on its own connection.

    rebound sim --mission wall --set sim.walls.0.height_m=10
    python guarded_offboard.py udpin://127.0.0.1:14540

The program knows nothing of the wall. It flies into it, the guard recovers and leaves the vehicle in hold, and the
program, which has been watching the guard, lands.
"""

import sys
import time

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action.action import Action
from mavsdk.plugins.offboard.offboard import Offboard, VelocityNedYaw
from mavsdk.plugins.telemetry.telemetry import Telemetry

from companion.mavsdk import CollisionGuard, State


def main(url: str) -> None:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER))
    mavsdk.add_any_connection(url)
    system = mavsdk.first_autopilot(15.0)
    if system is None:
        raise SystemExit(f"no vehicle at {url}")
    with CollisionGuard(mavsdk, system, on_event=lambda event: print(f"guard: {event.text}")) as guard:
        fly_north(Action(system), Offboard(system), Telemetry(system), guard)
    mavsdk.destroy()


def fly_north(action: Action, offboard: Offboard, telemetry: Telemetry, guard: CollisionGuard) -> None:
    while not telemetry.health_all_ok():
        time.sleep(0.2)
    action.arm()
    action.takeoff()
    if not guard.wait_for(lambda: guard.state is State.WATCHING, 20.0):
        raise SystemExit("the vehicle did not take off")
    time.sleep(4.0)
    offboard.set_velocity_ned(VelocityNedYaw(1.5, 0.0, 0.0, 0.0))
    offboard.start()
    if guard.wait_for(lambda: guard.holds, 10.0):
        guard.wait_for(lambda: not guard.holds, 20.0)
        hit = guard.collisions[-1]
        print(f"program: flew into something at {hit.impact_speed_m_s:.2f} m/s, landing")
    action.land()
    while telemetry.armed():
        time.sleep(0.2)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "udpin://0.0.0.0:14540")
