"""The command `python -m bench`: the paper's studies, detectors on their bench, random missions, faults."""

import argparse
import sys
from collections.abc import Sequence

from bench.ablation.arguments import add_ablation
from bench.campaign_report.arguments import add_campaign
from bench.corpus.arguments import add_corpus
from bench.detectors_report.arguments import add_detectors
from bench.faults.arguments import add_faults
from bench.kills.arguments import add_kills
from bench.paper.arguments import add_paper
from bench.pictures.arguments import add_pictures
from bench.reference.arguments import add_docs, add_stamps
from bench.soak.arguments import add_soak
from bench.speed.arguments import add_speed
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
    add_kills(commands)
    add_faults(commands)
    add_speed(commands)
    add_soak(commands)
    add_pictures(commands)
    add_docs(commands)
    add_stamps(commands)
    return parser
