"""The guard on a program's own MAVSDK 4, in real time: from a hit to its setpoint on the wire, and to the vehicle.

    python tests/benchmarks/bench_guard.py [--hits 100] [--busy]

`rebound sim` with a wall, a tap of the wire and the program are processes of their own. The program flies at the wall
by OFFBOARD at 1 m/s and never stops; after each recovery the guard gives OFFBOARD back to it, so that it hits again.
All times are the tap's: from when the datagram with the HIGHRES_IMU that shows the hit went on to the program, to when
the first recovery setpoint came from it. `--busy`: beside it a thread of the program's computes all the time.
"""

import argparse
import itertools
import math
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "clients")]

from simulator import free_port, simulator, wait_until  # noqa: E402
from tap import messages, tapped  # noqa: E402

PLACE_IGNORED, VELOCITY_IGNORED = 0x7, 0x38
BAR_MS = 5.0
HOLD = 3
# The vehicle follows when it is this near to the moving setpoint, and stays so.
FOLLOWS_WITHIN_M = 0.10
FOLLOWS_FOR_S = 0.2
# Approach and recovery take 4 s.
LONGEST_S_A_HIT = 10.0


@dataclass(frozen=True)
class Handover:
    """Seconds from the datagram that shows the hit; `given_back` from the last recovery setpoint."""

    setpoint_s: float
    taken_up_s: float | None
    follows_s: float | None
    given_back_s: float | None
    slipped_through: int


def fly(hits: int, is_busy: bool, record: Path) -> list[int]:
    """The boot times of the samples that showed the hits."""
    from mavsdk import ComponentType, Configuration, Mavsdk
    from mavsdk.plugins.action.action import Action
    from mavsdk.plugins.offboard.offboard import Offboard, VelocityNedYaw
    from mavsdk.plugins.telemetry.telemetry import Telemetry

    from companion.mavsdk import CollisionGuard, GuardConfig, State

    port = free_port()
    world = ("--mission", str(ROOT / "missions" / "wall.yaml"), "--set", "sim.walls.0.height_m=20")
    with simulator(*world) as simulated, tapped(record, simulated.companion_port, port):
        mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER))
        mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        system = mavsdk.first_autopilot(15.0)
        with CollisionGuard(mavsdk, system, GuardConfig(then="previous", max_hits=hits)) as guard:
            action, telemetry = Action(system), Telemetry(system)
            wait_until(telemetry.health_all_ok, 20.0, "healthy")
            action.arm()
            action.takeoff()
            guard.wait_for(lambda: guard.state is State.WATCHING, 20.0)
            wait_until(lambda: int(telemetry.flight_mode()) == HOLD, 20.0, "take-off over")
            offboard = Offboard(system)
            offboard.set_velocity_ned(VelocityNedYaw(1.0, 0.0, 0.0, 0.0))
            offboard.start()
            if is_busy:
                threading.Thread(target=compute, daemon=True).start()
            guard.wait_for(lambda: len(guard.collisions) >= hits and not guard.holds, hits * LONGEST_S_A_HIT)
            found = [event for event in guard.events if event.kind == "take_over"]
            boots = [hit.sample_time_boot_us for hit in guard.collisions]
            taken_us = {event.time_us for event in found}
            first = [hit for hit in guard.collisions if hit.detected_at_us in taken_us]
            print(
                f"{len(boots)} hits, {len(first)} of them while the program flew; {guard.kept_out} setpoints kept out"
            )
            boots = [hit.sample_time_boot_us for hit in first]
        mavsdk.destroy()
    return boots


def compute() -> None:
    while True:
        math.fsum(range(1000))


def measure(boots: list[int], record: Path) -> list[Handover]:
    wire = list(messages(record))
    return [handover(boot_us, wire) for boot_us in boots]


def handover(boot_us: int, wire: list[tuple[float, bool, Any]]) -> Handover:
    start = next(
        place
        for place, (_, inward, m) in enumerate(wire)
        if inward and m.get_type() == "HIGHRES_IMU" and m.time_usec == boot_us
    )
    shown_s, rest = wire[start][0], wire[start:]
    setpoints = [(at, m) for at, inward, m in rest if not inward and m.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
    own = [(at, m) for at, m in setpoints if not is_theirs(m)]
    first_s = own[0][0]
    # The recovery's own stream, up to its end: the next is of another hit.
    last = next((i for i, (a, b) in enumerate(itertools.pairwise(own)) if b[0] - a[0] > 0.3), len(own) - 1)
    last_s, mine = own[last][0], own[: last + 1]
    echoes = [(at, m) for at, inward, m in rest if inward and m.get_type() == "POSITION_TARGET_LOCAL_NED"]
    places = [(at, m) for at, inward, m in rest if inward and m.get_type() == "LOCAL_POSITION_NED" and at <= last_s]
    taken_up_s = next((at - shown_s for at, m in echoes if at > first_s and not is_theirs(m)), None)
    theirs = [at for at, m in setpoints if is_theirs(m)]
    back_s = next((at - last_s for at in theirs if at > last_s), None)
    slipped = sum(first_s < at < last_s for at in theirs)
    return Handover(first_s - shown_s, taken_up_s, follows_after(mine, places, shown_s), back_s, slipped)


def is_theirs(setpoint: Any) -> bool:
    """The program flies by velocity alone, the guard by place and velocity, or by a lean alone."""
    return bool(setpoint.type_mask & PLACE_IGNORED and not setpoint.type_mask & VELOCITY_IGNORED)


def follows_after(own: list[tuple[float, Any]], places: list[tuple[float, Any]], shown_s: float) -> float | None:
    """From when on the vehicle is where the setpoint is, to within FOLLOWS_WITHIN_M, for FOLLOWS_FOR_S."""
    since_s: float | None = None
    newest = 0
    for at, place in places:
        while newest + 1 < len(own) and own[newest + 1][0] <= at:
            newest += 1
        target = own[newest][1]
        away_m = math.dist((place.x, place.y, place.z), (target.x, target.y, target.z))
        if away_m > FOLLOWS_WITHIN_M or at < own[0][0]:
            since_s = None
        elif since_s is None:
            since_s = at
        elif at - since_s >= FOLLOWS_FOR_S:
            return since_s - shown_s
    return None


def row(name: str, seconds: list[float | None]) -> str:
    known = sorted(value * 1e3 for value in seconds if value is not None)
    if not known:
        return f"  {name:<46} none"
    at = [known[min(len(known) - 1, math.ceil(share * len(known)) - 1)] for share in (0.5, 0.99)]
    return f"  {name:<46} {at[0]:8.2f} {at[1]:8.2f} {known[-1]:8.2f} ms  ({len(known)})"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hits", type=int, default=100)
    parser.add_argument("--busy", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "wire"
        began_s = time.monotonic()
        boots = fly(options.hits, options.busy, record)
        flown = measure(boots, record)
        took_s = time.monotonic() - began_s
    print(f"  {'':<46} {'50 %':>8} {'99 %':>8} {'most':>8}")
    print(row("hit's datagram to first recovery setpoint", [one.setpoint_s for one in flown]))
    print(row("... to the vehicle's control flying to it", [one.taken_up_s for one in flown]))
    print(row(f"... to within {FOLLOWS_WITHIN_M:g} m of the setpoint", [one.follows_s for one in flown]))
    print(row("last recovery setpoint to the program's next", [one.given_back_s for one in flown]))
    slipped = sum(one.slipped_through for one in flown)
    print(f"  the program's setpoints that came through while the guard held: {slipped}; {took_s:.0f} s")
    late = sorted(one.setpoint_s for one in flown)[math.ceil(0.99 * len(flown)) - 1] * 1e3
    return 0 if late <= BAR_MS and not slipped else 1


if __name__ == "__main__":
    sys.exit(main())
