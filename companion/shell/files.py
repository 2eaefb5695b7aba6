"""Files that a power cut does not leave half written."""

import os
from pathlib import Path


def write_whole(path: Path, content: bytes) -> None:
    """Whenever the program or the power ends, the file is whole: the old one, the new one or none."""
    unfinished = path.with_name(f"{path.name}.part")
    with unfinished.open("wb") as file:
        file.write(content)
        file.flush()
        # Without this a file system may know the new name before the content.
        os.fsync(file.fileno())
    unfinished.replace(path)
