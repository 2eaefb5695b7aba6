"""The arguments of `rebound preflight`."""

from rebound_cli.arguments import Commands, add_companion, add_connect, add_json, add_peer, add_signing_key, runs


def add_preflight(commands: Commands) -> None:
    preflight = commands.add_parser(
        "preflight",
        help="look at a connected vehicle before its first flight",
        description="Parameters, streams, time, estimate and vibration, each with its remedy; see docs/preflight.md.",
    )
    add_connect(preflight, required=True)
    add_peer(preflight)
    add_signing_key(preflight)
    add_companion(preflight)
    preflight.add_argument("--fix", action="store_true", help="offer to set the parameters that would mend it")
    preflight.add_argument("--yes", action="store_true", help="with --fix: set them without asking")
    add_json(preflight, "findings")
    preflight.set_defaults(run=runs("rebound_cli.preflight.command:run_preflight"))
