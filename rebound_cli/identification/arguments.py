"""The arguments of `rebound identify`."""

from pathlib import Path

from rebound_cli.arguments import Commands, mass_kg, runs


def add_identify(commands: Commands) -> None:
    identify = commands.add_parser(
        "identify",
        help="find an airframe's springs in recorded hits",
        description="Fits stiffness, damping and restitution to hits on a wall; see docs/airframes.md.",
    )
    identify.add_argument(
        "data", type=Path, nargs="+", metavar="DATA", help="a CSV file, a .tlog or a run's folder: one hit each"
    )
    identify.add_argument("--mass", type=mass_kg, metavar="KG", help="of the vehicle; known for simulated runs")
    identify.add_argument("--axis", choices=("x", "y"), help="CSV: it is square to the wall (default: by the turn)")
    identify.add_argument("--out", type=Path, metavar="FILE", help="write an airframe file")
    identify.add_argument("--name", help="name of the airframe (default: the file's)")
    identify.add_argument(
        "--based-on", metavar="NAME", help="airframe for all else (default: foldable, rigid where no spring is seen)"
    )
    identify.set_defaults(run=runs("rebound_cli.identification.command:run_identify"))
