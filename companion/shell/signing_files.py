"""The files of message signing: the key, and beside it the time stamp that outlives the program.

A key is 32 bytes, written as 64 hexadecimal digits; only its owner may read the file. No error's text holds what a file
does.
"""

import os
import re
from pathlib import Path

from companion.errors import ConfigurationError
from companion.mavlink.signing import KEY_LENGTH, LAST_STAMP, MINUTE, stamp_at
from companion.shell import files

_DIGITS = re.compile(rb"\s*([0-9a-fA-F]{64})\s*")
_STAMP = re.compile(rb"\s*([0-9]{1,15})\s*")
# A key with white space around it is shorter: of a longer file no more has to be read.
_MOST_BYTES = 200
_FOR_OTHERS = 0o077


def read_key(path: Path) -> bytes:
    """The key. Raises ConfigurationError."""
    try:
        with path.open("rb") as file:
            mode, content = os.fstat(file.fileno()).st_mode, file.read(_MOST_BYTES)
    except OSError as error:
        text = f"key {path}: cannot be read: {error.strerror}; `rebound key new {path}` makes one."
        raise ConfigurationError(text) from None
    if mode & _FOR_OTHERS:
        text = f"key {path}: not only its owner may use it (mode {mode & 0o777:03o}): chmod 600 {path}"
        raise ConfigurationError(f"{text}, or make a new key if others could have read it.")
    digits = _DIGITS.fullmatch(content)
    key = bytes.fromhex(digits[1].decode()) if digits is not None else b""
    if not any(key):
        text = f"key {path}: not a key, which is {2 * KEY_LENGTH} hexadecimal digits and not all 0"
        raise ConfigurationError(f"{text}; `rebound key new FILE` makes one.")
    return key


def write_new(path: Path, content: bytes) -> None:
    """A file for its owner alone, where there is none yet. Raises ConfigurationError."""
    try:
        files.write_new(path, content, mode=0o600)
    except FileExistsError:
        raise ConfigurationError(f"{path} exists already and is left as it is: give another name.") from None
    except OSError as error:
        raise ConfigurationError(f"{path}: cannot be written: {error.strerror}.") from None


class StampFile:
    """The newest time stamp, beside the key under its name and `.stamp`."""

    def __init__(self, key_file: Path) -> None:
        self._path = key_file.with_name(key_file.name + ".stamp")

    def first(self, now_us: int) -> int:
        """The time stamp to begin with: by the clock, or two minutes after the one kept, if that is later. It is kept.

        In the first, more may have been sent and heard before the program ended. The second is how far behind the first
        packet of a stream may be. So nothing recorded before passes now, even where the clock was set back.
        Raises ConfigurationError.
        """
        stamp = self._next(now_us)
        try:
            self.keep(stamp)
        except OSError as error:
            text = f"{self._path}: cannot be written: {error.strerror}; keep the key in a folder that you may write to."
            raise ConfigurationError(text) from None
        return stamp

    def _next(self, now_us: int) -> int:
        try:
            content = self._path.read_bytes()
        except FileNotFoundError:
            return max(stamp_at(now_us), 0)
        except OSError as error:
            raise ConfigurationError(f"{self._path}: cannot be read: {error.strerror}.") from None
        kept = _STAMP.fullmatch(content)
        if kept is None or int(kept[1]) > LAST_STAMP:
            text = f"{self._path} holds no time stamp; once the clock is right, delete it"
            raise ConfigurationError(f"{text}: it keeps packets that were recorded before from being played again.")
        return min(max(stamp_at(now_us), int(kept[1]) + 2 * MINUTE), LAST_STAMP)

    def keep(self, stamp: int) -> None:
        """Whenever the program or the power ends, the file holds the old stamp or the new one. Raises OSError."""
        files.write_whole(self._path, b"%d\n" % stamp)
