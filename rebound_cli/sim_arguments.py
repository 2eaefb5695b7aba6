"""The arguments of `rebound sim`."""

import os
from pathlib import Path

from rebound_cli.arguments import (
    SIMULATED_AUTOPILOTS,
    Commands,
    add_world_options,
    host_and_port,
    instance,
    port,
    runs,
    speed,
)


def add_sim(commands: Commands) -> None:
    sim = commands.add_parser(
        "sim",
        help="run the simulated vehicle alone",
        description="A simulated PX4 quadrotor for any MAVLink client.",
    )
    sim.add_argument("--mission", type=Path, metavar="FILE", help="mission file whose sim: part describes the world")
    add_world_options(sim)
    sim.add_argument(
        "--autopilot",
        choices=SIMULATED_AUTOPILOTS,
        default="builtin",
        help="px4: your PX4 SITL flies the vehicle's body in lockstep, see docs/px4.md",
    )
    sim.add_argument(
        "--port",
        type=port,
        help="UDP port to listen on for the companion (default 14580 + instance; 0: any free one); "
        "with --autopilot px4 the TCP port (4560)",
    )
    sim.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="with --autopilot px4: where to listen for it (default 127.0.0.1: this machine alone)",
    )
    sim.add_argument(
        "--speed",
        type=speed,
        default=os.environ.get("PX4_SIM_SPEED_FACTOR") or "1",
        metavar="N",
        help="at most N times real time, 0 for as fast as it goes (default: $PX4_SIM_SPEED_FACTOR, else 1)",
    )
    sim.add_argument(
        "--sensor-rate",
        type=int,
        choices=(250, 500, 1000),
        default=1000,
        help="with --autopilot px4: HIL_SENSOR a second; 250 is three times as fast and less like a real sensor",
    )
    sim.add_argument(
        "--remote",
        type=host_and_port,
        metavar="HOST:PORT",
        help="where the companion's link sends unasked (default 127.0.0.1:14540 + instance)",
    )
    sim.add_argument(
        "--link",
        action="append",
        default=[],
        metavar="URL",
        help="one more link, e.g. tcpin://0.0.0.0:5760 or serial:///dev/ttyUSB0:57600; see docs/vehicle.md",
    )
    sim.add_argument(
        "--instance", type=instance, default=0, metavar="N", help="adds N to the UDP ports and to the system's number"
    )
    sim.add_argument(
        "--truth", type=Path, metavar="FILE", help="write what really happened to this .npz file at the end"
    )
    sim.add_argument(
        "--signing",
        choices=("any-link", "px4-1.17"),
        default="any-link",
        help="how it is given a key of message signing: by SETUP_SIGNING on any link, or as PX4 1.17 (docs/vehicle.md)",
    )
    sim.add_argument("--signing-key", type=Path, metavar="FILE", help="it has this key, and MAV_SIGN_CFG is 1")
    sim.add_argument("--stop-with-stdin", action="store_true", help="end when standard input ends")
    sim.set_defaults(run=runs("rebound_cli.sim:run_sim"))
