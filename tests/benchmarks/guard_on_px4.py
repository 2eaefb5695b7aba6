"""The guard on a real PX4: a hit in a mode of PX4's own, the recovery, and what becomes of the vehicle afterwards.

    rebound airframe px4 --position gps > /tmp/gps.sh; . /tmp/gps.sh; make px4_sitl none_iris      in the PX4 checkout
    python tests/benchmarks/guard_on_px4.py --flight goto --speed 2

The body with a wall 4 m north is simulated here; PX4 flies it, asked through MAVSDK: to a place (AUTO.LOITER), a
mission, or sticks (POSCTL). Places are true ones; end PX4 afterwards (Ctrl-C), for it takes no second simulator.
"""

import argparse
import math
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT)]

from companion.mavsdk import CollisionGuard, GuardConfig, State  # noqa: E402
from sim_vehicle.shell.truth_file import load_truth  # noqa: E402

METRE_DEG = math.degrees(1 / 6_371_000)
# Behind the wall, and far enough that braking has not begun where the wall stands.
GOAL_NORTH_M = 8.0
# After it was given back: PX4 takes 5 s to find that its position is not what it should be.
WATCHED_AFTERWARDS_S = 8.0
LANDED = threading.Event()


def goto(system: Any, here: Any, speed_m_s: float) -> None:
    from mavsdk.plugins.action.action import Action

    north_deg = here.latitude_deg + GOAL_NORTH_M * METRE_DEG
    Action(system).goto_location(north_deg, here.longitude_deg, here.absolute_altitude_m, 0.0)


def mission(system: Any, here: Any, speed_m_s: float) -> None:
    from mavsdk.plugins.mission_raw.mission_raw import MissionItem, MissionRaw

    raw = MissionRaw(system)
    norths_m = (0.0, GOAL_NORTH_M, 0.0)
    places = [round((here.latitude_deg + north_m * METRE_DEG) * 1e7) for north_m in norths_m]
    east = round(here.longitude_deg * 1e7)
    items = [MissionItem(i, 6, 16, int(i == 0), 1, 0, 0, 0, math.nan, x, east, 2.5, 0) for i, x in enumerate(places)]
    raw.upload_mission(items)
    time.sleep(1)  # PX4 looks at a new mission before it flies it
    raw.start_mission()


def sticks(system: Any, here: Any, speed_m_s: float) -> None:
    """Forward; the stick's expo makes 1 m/s of 0.3."""
    from mavsdk.plugins.manual_control.manual_control import ManualControl

    manual, forward = ManualControl(system), [0.0]

    def hold() -> None:
        while not LANDED.wait(0.05):
            manual.set_manual_control_input(forward[0], 0.0, 0.5, 0.0)

    threading.Thread(target=hold, daemon=True).start()
    time.sleep(1)
    manual.start_position_control()
    time.sleep(1.5)
    forward[0] = speed_m_s / 3


FLIGHTS = {"goto": goto, "mission": mission, "sticks": sticks}


def fly(options: argparse.Namespace) -> None:
    from mavsdk import ComponentType, Configuration, Mavsdk
    from mavsdk.plugins.action.action import Action
    from mavsdk.plugins.param.param import Param
    from mavsdk.plugins.telemetry.telemetry import Telemetry

    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER))
    mavsdk.add_any_connection(f"udpin://0.0.0.0:{14540 + options.instance}")
    system = mavsdk.first_autopilot(60)
    if system is None:
        sys.exit("no PX4 within 60 s")
    action, telemetry, parameters = Action(system), Telemetry(system), Param(system)
    parameters.set_param_float("MPC_XY_CRUISE", options.speed)
    if options.flight == "sticks":
        parameters.set_param_int("COM_RC_IN_MODE", 1)
    with CollisionGuard(mavsdk, system, GuardConfig(then=options.then), on_event=tell) as guard:
        until(telemetry.health_all_ok, 60)
        action.set_takeoff_altitude(2.5)
        action.arm()
        action.takeoff()
        guard.wait_for(lambda: guard.state is State.WATCHING, 30)
        time.sleep(7)
        FLIGHTS[options.flight](system, telemetry.position(), options.speed)
        guard.wait_for(lambda: guard.holds, 30)
        guard.wait_for(lambda: not guard.holds, 20)
        time.sleep(WATCHED_AFTERWARDS_S)
        print(f"{len(guard.collisions)} hits; {guard.state.value}; the vehicle's mode: {telemetry.flight_mode().name}")
    action.land()
    LANDED.set()
    time.sleep(1)
    mavsdk.destroy()


def until(condition: Any, timeout_s: float) -> None:
    for _ in range(round(timeout_s / 0.5)):
        if condition():
            return
        time.sleep(0.5)


def tell(event: Any) -> None:
    if event.kind not in ("streams", "standing_by"):
        print(f"  {event.kind:10s} {event.text}", flush=True)


def report(truth: Path) -> None:
    hits, series, _ = load_truth(truth)
    if not hits:
        print("true: no hit")
        return
    boot_us, place_ned_m = series["time_boot_us"], series["position_ned_m"]
    hit = int(boot_us.searchsorted(hits[0].contact_at_boot_us)) - 1
    speed_m_s = float((series["velocity_ned_m_s"][hit] ** 2).sum() ** 0.5)
    after = place_ned_m[hit : boot_us.searchsorted(boot_us[hit] + 10e6)]
    print(f"true: {len(hits)} hits, the first at {speed_m_s:.2f} m/s; within 10 s after it at most")
    print(f"  {after[0, 0] - after[:, 0].min():.2f} m back, {after[:, 2].max() - after[0, 2]:.2f} m lower")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flight", choices=FLIGHTS, default="goto")
    parser.add_argument("--speed", type=float, default=2.0, help="m/s (MPC_XY_CRUISE)")
    parser.add_argument("--then", choices=("hold", "previous"), default="hold")
    parser.add_argument("--instance", type=int, default=0, help="PX4's option -i")
    parser.add_argument("--airframe", default="foldable")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "truth.npz"
        command = [sys.executable, "-m", "rebound_cli", "sim", "--autopilot", "px4", "--airframe", chosen.airframe]
        command += ["--port", str(4560 + chosen.instance), "--mission", str(ROOT / "missions" / "wall.yaml")]
        command += ["--set", "sim.walls.0.height_m=20", "--set", "sim.walls.0.width_m=20", "--truth", str(path)]
        body = subprocess.Popen(command, cwd=ROOT)
        try:
            fly(chosen)
        finally:
            body.send_signal(signal.SIGINT)
            body.wait(60)
        report(path)
