"""The arguments of `bench corpus`."""

from pathlib import Path

from bench.arguments import add_workers
from bench.detectors_report.arguments import add_data
from rebound_cli.arguments import Commands, count, runs


def add_corpus(commands: Commands) -> None:
    corpus = commands.add_parser(
        "corpus",
        help="record flights with their truth, and compare on them what two versions of the code make of them",
        description="A corpus is a folder of run folders, recorded here or brought along, such as those of real PX4.",
    )
    parts = corpus.add_subparsers(required=True, metavar="PART", dest="part")
    record = parts.add_parser("record", help="fly random missions with drawn vehicles and keep bytes and truth")
    record.add_argument("folder", type=Path, metavar="FOLDER")
    record.add_argument("--missions", type=count, default=500, metavar="N", help="with each kind (default 500)")
    record.add_argument("--first-seed", type=count, default=1, metavar="SEED", help="of the first (default 1)")
    record.add_argument("--jobs", type=count, default=1, metavar="N", help="processes (default 1)")
    record.set_defaults(run=runs("bench.corpus.command:run_record"))
    judge = parts.add_parser("judge", help="let this version of the code hear every flight, and write its verdicts")
    judge.add_argument("folder", type=Path, metavar="FOLDER")
    judge.add_argument("--out", type=Path, required=True, metavar="FILE", help="verdicts, as JSON")
    add_data(judge)
    add_workers(judge)
    judge.set_defaults(run=runs("bench.corpus.command:run_judge"))
    compare = parts.add_parser("compare", help="print what has changed between two files of verdicts")
    compare.add_argument("old", type=Path, metavar="OLD")
    compare.add_argument("new", type=Path, metavar="NEW")
    compare.set_defaults(run=runs("bench.corpus.command:run_compare"))
