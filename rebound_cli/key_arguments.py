"""The arguments of `rebound key`."""

from pathlib import Path

from rebound_cli.arguments import Commands, runs


def add_key(commands: Commands) -> None:
    key = commands.add_parser(
        "key",
        help="make a key for MAVLink's message signing",
        description="The key that a vehicle and those who may command it share; see docs/security.md.",
    )
    key.add_argument(
        "what", choices=("new", "px4"), help="new: make a key; px4: write it as the file that PX4 has on its SD card"
    )
    key.add_argument("file", type=Path, metavar="FILE", help="the key's file")
    key.add_argument(
        "--passphrase",
        action="store_true",
        help="new: ask for a passphrase, from which QGroundControl and MAVProxy make the same key (SHA-256)",
    )
    key.add_argument(
        "--card",
        type=Path,
        default=Path("mavlink-signing-key.bin"),
        metavar="FILE",
        help="px4: the file to write, to be copied to mavlink/ on the card (default: mavlink-signing-key.bin)",
    )
    key.set_defaults(run=runs("rebound_cli.key:run_key"))
