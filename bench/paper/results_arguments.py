"""The arguments of `bench paper results`."""

from pathlib import Path

from bench.arguments import add_jobs
from rebound_cli.arguments import Commands, count, runs


def add_results(commands: Commands) -> None:
    results = commands.add_parser(
        "results",
        help="fly the wall hits of the paper and write the table",
        description="Lockstep wall hits at four speeds with both airframes, as a table in Markdown.",
    )
    results.add_argument(
        "--out", type=Path, default=Path("build/results.md"), metavar="FILE", help="default: %(default)s"
    )
    results.add_argument("--seeds", type=count, default=20, help="flights for each speed and airframe (default 20)")
    add_jobs(results)
    results.set_defaults(run=runs("bench.paper.results:run_results"))
