"""The arguments of `bench campaign recoveries`."""

from pathlib import Path

from bench.arguments import add_jobs
from rebound_cli.arguments import Commands, count, runs


def add_recoveries(commands: Commands) -> None:
    recoveries = commands.add_parser(
        "recoveries",
        help="fly the same hits with two recovery laws and write the table",
        description="Lockstep wall hits at 1 to 5 m/s, square and slanted, both airframes, laws paper and adaptive.",
    )
    recoveries.add_argument(
        "--out", type=Path, default=Path("build/recovery.md"), metavar="FILE", help="default: %(default)s"
    )
    recoveries.add_argument("--seeds", type=count, default=10, help="flights for each hit and law (default 10)")
    add_jobs(recoveries)
    recoveries.set_defaults(run=runs("bench.recoveries.command:run_recoveries"))
