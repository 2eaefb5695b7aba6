"""The arguments of `bench soak`."""

from pathlib import Path

from rebound_cli.arguments import Commands, count, runs


def add_soak(commands: Commands) -> None:
    soak = commands.add_parser(
        "soak",
        help="run the guard as a service by the clock: a hit a minute, reboots, an unplugged line, a full disk",
        description="By the clock, on a serial line that loses packets. The disk is filled only where DIR is a file "
        "system of less than 1 GB: mount -t tmpfs -o size=128m tmpfs DIR.",
    )
    soak.add_argument("--minutes", type=count, default=120, metavar="N", help="default 120")
    soak.add_argument("--loss", type=float, default=0.05, metavar="SHARE", help="of the packets (default 0.05)")
    soak.add_argument("--folder", type=Path, required=True, metavar="DIR", help="where the service records its flights")
    soak.add_argument(
        "--python", metavar="PATH", help="of the environment that the guard has, such as a drone's (default: this one)"
    )
    note = Path("build/soak.md")
    soak.add_argument("--out", type=Path, default=note, metavar="FILE", help="default: %(default)s")
    soak.set_defaults(run=runs("bench.soak.command:run_soak"))
