"""The arguments of `bench kills`."""

from pathlib import Path

from bench.arguments import add_workers
from rebound_cli.arguments import Commands, count, runs


def add_kills(commands: Commands) -> None:
    kills = commands.add_parser(
        "kills",
        help="kill the companion at random instants around a hit and write what becomes of the vehicle",
        description="Wall hits at 0.7 to 5 m/s; the companion is killed from 0.3 s before to 1.5 s after the touch.",
    )
    kills.add_argument("--kills", type=count, default=1000, metavar="N", help="so many kills (default 1000)")
    kills.add_argument("--first-seed", type=count, default=1, metavar="SEED", help="of the first flight (default 1)")
    kills.add_argument(
        "--out", type=Path, default=Path("build/kills.md"), metavar="FILE", help="default: build/kills.md"
    )
    add_workers(kills)
    kills.set_defaults(run=runs("bench.kills.command:run_kills"))
