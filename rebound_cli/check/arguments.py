"""The arguments of `rebound check`."""

from pathlib import Path

from rebound_cli.arguments import Commands, add_set, mission_file, runs


def add_check(commands: Commands) -> None:
    check = commands.add_parser(
        "check",
        help="check a mission file and show what would be flown",
        description="Validates mission files, prints what would be flown and when, and draws it.",
    )
    check.add_argument(
        "missions", type=mission_file, nargs="*", metavar="MISSION", help="mission files, or names of ones that ship"
    )
    check.add_argument(
        "--schema", action="store_true", help="print the JSON schema of mission files, for editors, and nothing else"
    )
    add_set(check, "change a value of the mission file, e.g. items.1.go_to.speed_m_s=2.5")
    check.add_argument(
        "--out",
        type=Path,
        default=Path("runs/check"),
        metavar="DIR",
        help="folder of the pictures (default: runs/check)",
    )
    check.add_argument("--no-picture", action="store_true", help="draw nothing")
    check.set_defaults(run=runs("rebound_cli.check.command:run_check"))
