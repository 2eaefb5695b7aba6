"""The arguments of `bench pictures`."""

from pathlib import Path

from rebound_cli.arguments import Commands, runs


def add_pictures(commands: Commands) -> None:
    text = "Flies into a wall and makes the manual's pictures of it: the flight's figure, the hit as an animation, the "
    text += "report as a browser shows it. Stamps the pages that show them. Needs Chromium."
    pictures = commands.add_parser("pictures", help="make the manual's pictures", description=text)
    out = "folder of README.md and docs (default: here)"
    pictures.add_argument("--out", type=Path, default=Path("."), metavar="DIR", help=out)
    pictures.set_defaults(run=runs("bench.pictures.command:run_pictures"))
