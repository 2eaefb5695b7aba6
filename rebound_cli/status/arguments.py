"""The arguments of `rebound status`."""

from pathlib import Path

from rebound_cli.arguments import Commands, add_json, runs


def add_status(commands: Commands) -> None:
    status = commands.add_parser(
        "status",
        help="what a running guard or flight is doing",
        description="Asks a running `guard` or `fly --connect` on this machine; see docs/logs.md.",
    )
    status.add_argument(
        "--socket", type=Path, metavar="PATH", help="where to ask (default: this session, then the service)"
    )
    add_json(status, "status")
    status.set_defaults(run=runs("rebound_cli.status.asking:run_status"))
