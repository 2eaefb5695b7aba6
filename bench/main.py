"""The command `python -m bench`: the paper's studies, detectors on their bench, random missions, faults."""

import argparse
import sys
from collections.abc import Sequence

from bench.ablation.arguments import add_ablation
from bench.campaign_report.arguments import add_campaign
from bench.corpus.arguments import add_corpus
from bench.detectors_report.arguments import add_detectors
from bench.faults.arguments import add_faults
from bench.flights import add_flights
from bench.hits_report.arguments import add_hits
from bench.kills.arguments import add_kills
from bench.paper.arguments import add_paper
from bench.pictures.arguments import add_pictures
from bench.soak.arguments import add_soak
from bench.speed.arguments import add_speed
from rebound_cli.arguments import Commands, runs
from rebound_cli.main import run


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one study and return its exit code."""
    return run(build_parser().parse_args(sys.argv[1:] if arguments is None else arguments), "bench")


def build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m bench", description="Studies of Rebound and their tables; needs a checkout and its environment."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="command")
    add_paper(commands)
    add_detectors(commands)
    add_campaign(commands)
    add_corpus(commands)
    add_ablation(commands)
    add_flights(commands)
    add_hits(commands)
    add_kills(commands)
    add_faults(commands)
    add_speed(commands)
    add_soak(commands)
    add_pictures(commands)
    _add_docs(commands)
    _add_stamps(commands)
    return parser


def _add_docs(commands: Commands) -> None:
    text = "Models, arguments, state tables and docstrings as the pages of docs/reference."
    docs = commands.add_parser("docs", help="write the generated pages of the manual", description=text)
    docs.add_argument("--check", action="store_true", help="write nothing; exit 1 where a page is not up to date")
    docs.set_defaults(run=runs("bench.reference.command:run_docs"))


def _add_stamps(commands: Commands) -> None:
    text = "Lists figures and tables of the manual that are older than the code they speak of, or bear no stamp."
    stamps = commands.add_parser("stamps", help="look for figures and tables that are out of date", description=text)
    stamps.add_argument("--release", action="store_true", help="exit 1 where there is one")
    stamps.set_defaults(run=runs("bench.stamps:run_stamps"))
