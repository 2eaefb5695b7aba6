"""The arguments of `rebound fly`."""

from pathlib import Path

from rebound_cli.arguments import (
    SIMULATED_AUTOPILOTS,
    Commands,
    add_companion,
    add_connect,
    add_json,
    add_peer,
    add_signing_key,
    add_world_options,
    instance,
    mission_file,
    runs,
)


def add_fly(commands: Commands) -> None:
    fly = commands.add_parser("fly", help="fly a mission", description="Fly a mission from take-off to landing.")
    fly.add_argument(
        "mission", type=mission_file, metavar="MISSION", help="mission file, or the name of one that ships: wall"
    )
    how = fly.add_mutually_exclusive_group()
    how.add_argument(
        "--sim",
        nargs="?",
        const="builtin",
        default="builtin",
        choices=SIMULATED_AUTOPILOTS,
        metavar="px4",
        help="start the simulated vehicle and fly it in real time over UDP, as without any of these; "
        "px4: with your PX4 as its autopilot, see docs/px4.md",
    )
    how.add_argument("--lockstep", action="store_true", help="simulate in this process, as fast as the machine allows")
    add_connect(how, required=False)
    add_world_options(fly)
    fly.add_argument("--out", type=Path, metavar="DIR", help="folder of this run (default: runs/<time>-<mission>)")
    fly.add_argument(
        "--instance", type=instance, default=0, metavar="N", help="with --sim px4: PX4's instance (its option -i)"
    )
    add_companion(fly)
    fly.add_argument(
        "--resume",
        type=Path,
        metavar="RUN",
        help="go on with the mission where the flight in this folder was interrupted",
    )
    fly.add_argument(
        "--obstacles",
        type=Path,
        metavar="FILE",
        help="what is known beforehand, e.g. another run's obstacles.json",
    )
    add_json(fly, "summary")
    add_peer(fly)
    add_signing_key(fly)
    fly.add_argument("--yes", action="store_true", help="with --connect: fly the plan without asking")
    fly.set_defaults(run=runs("rebound_cli.fly:run_fly"))
