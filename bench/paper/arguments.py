"""The arguments of `bench paper`."""

from bench.arguments import add_documents_folder, add_jobs
from bench.paper.results_arguments import add_results
from rebound_cli.arguments import Commands, count, runs

# Chosen so that all of it takes less than five minutes on two cores.
DEFAULT_SEEDS = 6


def add_paper(commands: Commands) -> None:
    paper = commands.add_parser(
        "paper",
        help="fly the paper's studies and write figures and table",
        description="The paper's figures and numbers beside ours, flown in lockstep; see bench/notes/paper.md.",
    )
    add_documents_folder(paper, "paper.md and images/paper")
    paper.add_argument(
        "--seeds",
        type=count,
        default=DEFAULT_SEEDS,
        help=f"walls from any side: flights at each speed (default {DEFAULT_SEEDS})",
    )
    add_jobs(paper)
    paper.set_defaults(run=runs("bench.paper.command:run_paper"))
    add_results(paper.add_subparsers(metavar="PART", dest="part"))
