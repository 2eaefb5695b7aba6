"""The arguments of `bench hits`."""

from pathlib import Path

from bench.arguments import BUILD, add_vehicles, add_workers
from rebound_cli.arguments import Commands, count, runs


def add_hits(commands: Commands) -> None:
    hits = commands.add_parser(
        "hits",
        help="fly hits alone, from just before each to rest, and write which were missed",
        description="Hits on walls and poles by vehicles that begin in flight, guarded through the whole wire.",
    )
    hits.add_argument("--hits", type=count, default=1000, metavar="N", help="default 1000")
    hits.add_argument("--first-seed", type=count, default=1, metavar="SEED", help="of the first hit (default 1)")
    add_vehicles(hits, "every hit")
    add_workers(hits)
    instead = hits.add_mutually_exclusive_group()
    instead.add_argument(
        "--verdicts",
        dest="part",
        action="store_const",
        const="verdicts",
        help="fly each hit only until the guard tells of it, dozens from one approach: a million an hour",
    )
    instead.add_argument(
        "--worst",
        dest="part",
        nargs="?",
        const="margin",
        choices=("margin", "recovery"),
        help="search the hits nearest to being missed (default), or those with the worst recovery: N tries for each "
        "airframe and rate, the vehicle included",
    )
    instead.add_argument(
        "--growth",
        dest="part",
        action="store_const",
        const="growth",
        help="write instead what a hit costs after 1, 10, 100 to N of them",
    )
    hits.add_argument(
        "--corpus", type=Path, metavar="FOLDER", help="with --worst: keep their flights there, for `corpus judge`"
    )
    hits.add_argument("--out", type=Path, default=BUILD / "hits.md", metavar="FILE", help="default: %(default)s")
    hits.set_defaults(run=runs("bench.hits_report.command:run_hits"))
