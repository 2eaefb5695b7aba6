"""The arguments of `bench faults`."""

from pathlib import Path

from bench.arguments import add_jobs
from rebound_cli.arguments import Commands, count, runs


def add_faults(commands: Commands) -> None:
    faults = commands.add_parser(
        "faults",
        help="inject faults and attacks into flights and write what became of them",
        description="Flights into a wall with a fault each, files that mean harm, and hits under load; "
        "see docs/reference/faults.md. A broken-off run goes on where it was.",
    )
    faults.add_argument("--seeds", type=count, default=50, metavar="N", help="flights of each fault (default 50)")
    faults.add_argument("--only", metavar="NAME", help="print the flights of this fault and write nothing")
    add_jobs(faults)
    faults.add_argument("--hits", type=count, default=1000, metavar="N", help="hits under load (default 1000)")
    page = Path("build/faults.md")
    faults.add_argument("--out", type=Path, default=page, metavar="FILE", help="default: %(default)s")
    faults.set_defaults(run=runs("bench.faults.command:run_faults"))
