"""The arguments of `rebound init`."""

from pathlib import Path

from rebound_cli.arguments import Commands, runs


def add_init(commands: Commands) -> None:
    init = commands.add_parser(
        "init",
        help="write a mission to begin with",
        description="A copy, to be changed, of one of the missions that ship with the program; see docs/missions.md.",
    )
    init.add_argument("file", type=Path, metavar="FILE", help="the file to write, such as my-mission.yaml")
    init.add_argument("--from", dest="model", default="wall", metavar="MISSION", help="which one (default: wall)")
    init.set_defaults(run=runs("rebound_cli.init:run_init"))
