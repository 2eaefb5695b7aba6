"""The arguments of `rebound guard`."""

from pathlib import Path

from rebound_cli.arguments import Commands, add_connect, add_peer, add_set, add_signing_key, runs


def add_guard(commands: Commands) -> None:
    guard = commands.add_parser(
        "guard",
        help="protect a flight that something else commands",
        description="Watches; at a hit takes the vehicle over, recovers and gives it back; see docs/guard.md.",
    )
    add_connect(guard, required=True)
    add_peer(guard)
    add_signing_key(guard)
    guard.add_argument("--config", type=Path, metavar="FILE", help="settings, as in docs/guard.md")
    add_set(guard, "change a setting, e.g. max_hits=5")
    guard.add_argument("--modes", metavar="A,B", help="the modes that may be taken over, e.g. POSCTL,AUTO.MISSION")
    guard.add_argument("--then", choices=("previous", "hold"), help="what the vehicle is given back to (default: hold)")
    guard.add_argument("--out", type=Path, metavar="DIR", help="where the log goes (default runs/<time>-guard)")
    guard.set_defaults(run=runs("rebound_cli.guard.command:run_guard"))
