"""The arguments of `bench ablation`."""

from pathlib import Path

from bench.ablation.rules import RULES
from bench.arguments import add_workers
from rebound_cli.arguments import Commands, count, runs


def add_ablation(commands: Commands) -> None:
    ablation = commands.add_parser(
        "ablation",
        help="fly drawn vehicles with and without each special rule of the companion, and write what each is worth",
        description="Where a rule first matters in a flight, a copy of the flight goes on without it; by the truth.",
    )
    ablation.add_argument("--missions", type=count, default=100, metavar="N", help="of each kind (default 100)")
    ablation.add_argument("--first-seed", type=count, default=1, metavar="SEED", help="of the first (default 1)")
    names = tuple(rule.name for rule in RULES)
    ablation.add_argument(
        "--rule", action="append", choices=names, metavar="NAME", help=f"one of: {', '.join(names)} (default: all)"
    )
    ablation.add_argument(
        "--out",
        type=Path,
        default=Path("build/ablation.md"),
        metavar="FILE",
        help="default: build/ablation.md",
    )
    ablation.add_argument(
        "--hits",
        type=count,
        metavar="N",
        help="drawn hits for the detector alone, with hands and flights",
    )
    ablation.add_argument(
        "--data", type=Path, metavar="DIR", help="with --hits: recorded flights and impacts, as `detectors` has them"
    )
    add_workers(ablation)
    ablation.set_defaults(run=runs("bench.ablation.command:run_ablation"))
