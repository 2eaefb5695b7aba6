"""The arguments of `rebound service`."""

from pathlib import Path

from rebound_cli.arguments import Commands, add_connect, mission_file, runs


def add_service(commands: Commands) -> None:
    service = commands.add_parser(
        "service",
        help="install the guard, or a mission, as a service of systemd",
        description="Started at boot, watched, started again; see docs/companion-computer.md.",
    )
    service.add_argument(
        "what",
        choices=("install", "status", "check", "uninstall"),
        help="install: also after an upgrade, keeps all settings; status: as systemd sees it; "
        "check: whether all is as it should be; uninstall: keeps settings and flights",
    )
    how = service.add_mutually_exclusive_group()
    how.add_argument("--guard", type=Path, metavar="CONFIG", help="install: guard with these settings, from boot on")
    how.add_argument(
        "--mission", type=mission_file, metavar="FILE", help="install: fly this each time somebody starts the service"
    )
    add_connect(service, required=False)
    service.add_argument("--dry-run", action="store_true", help="show what would be written or removed, and stop")
    service.set_defaults(run=runs("rebound_cli.service.command:run_service"))
