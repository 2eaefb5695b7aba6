"""`rebound key`: makes the key of message signing, and the file in which PX4 has it. The key itself is never shown."""

import hashlib
import secrets
import sys
from argparse import Namespace
from getpass import getpass
from pathlib import Path

from companion.errors import ConfigurationError
from companion.mavlink.signing import KEY_LENGTH
from companion.shell.signing_files import read_key, write_new

# PX4 has a time stamp of 64 bits behind the key (mavlink_sign_control.h); it takes a later one from whoever it hears.
_NO_STAMP = bytes(8)


def run_key(options: Namespace) -> None:
    """Raises ConfigurationError."""
    if options.what == "px4":
        write_new(options.card, read_key(options.file) + _NO_STAMP)
        print(f"{options.card}: copy it to mavlink/ on the SD card, start PX4 again, then delete it here.")
        return
    key = _from_passphrase() if options.passphrase else secrets.token_bytes(KEY_LENGTH)
    write_new(options.file, key.hex().encode() + b"\n")
    print(_next_steps(options.file, options.passphrase))


def _from_passphrase() -> bytes:
    """As QGroundControl and MAVProxy make it."""
    if sys.stdin.isatty():
        passphrase = getpass("Passphrase: ")
        if getpass("The same again: ") != passphrase:
            raise ConfigurationError("The two passphrases differ: no key was made.")
    else:
        passphrase = sys.stdin.readline().rstrip("\n")
    if not passphrase:
        raise ConfigurationError("An empty passphrase makes no key.")
    return hashlib.sha256(passphrase.encode()).digest()


def _next_steps(file: Path, is_from_passphrase: bool) -> str:
    usb = "\n    or over USB: send the passphrase from QGroundControl, or `signing setup` in MAVProxy"
    over_usb = usb if is_from_passphrase else ""
    return f"""The key is in {file}, for you alone. It is in no log; keep a copy in a safe place.

Give it to PX4 1.17 (docs/how-to/security.md has the details):
    rebound key px4 {file}    # writes mavlink-signing-key.bin: copy it to mavlink/ on the SD card{over_usb}
    restart PX4; then set MAV_SIGN_CFG = 1: signing on every link but USB

Use it here:
    rebound fly MISSION --connect URL --signing-key {file}"""
