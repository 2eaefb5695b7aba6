"""Files that neither a power cut nor a full disk leaves half written."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import BinaryIO


def write_whole(path: Path, content: bytes) -> None:
    """Whenever the program or the power ends, the file is whole: the old one, the new one or none."""
    unfinished = path.with_name(f"{path.name}.part")
    with unfinished.open("wb") as file, _kept_whole(file, unfinished):
        file.write(content)
    unfinished.replace(path)


def write_new(path: Path, content: bytes, mode: int = 0o666) -> None:
    """Raises FileExistsError where there is one, and leaves it as it is."""
    with open(path, "xb", opener=partial(os.open, mode=mode)) as file, _kept_whole(file, path):
        file.write(content)


@contextmanager
def _kept_whole(file: BinaryIO, path: Path) -> Iterator[None]:
    """What is written meanwhile is on the disk at the end; of a file that the disk does not take nothing is left."""
    try:
        yield
        file.flush()
        # Without this a file system may know the new name before the content.
        os.fsync(file.fileno())
    except OSError:
        path.unlink(missing_ok=True)
        raise
