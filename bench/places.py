"""Places for what hours of work are to write, made or refused before it begins."""

import os
from pathlib import Path

from rebound_cli.results.run_folder import RunFolderError


def make_folder(folder: Path) -> None:
    """Before hours of work that are to be written there. Raises RunFolderError where it cannot be had."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFolderError(f"The folder {folder} cannot be made: {error.strerror}.") from error
    if not os.access(folder, os.W_OK):
        raise RunFolderError(f"The folder {folder} cannot be written to.")


def make_place(file: Path) -> None:
    """The same for a single file, of which only the folder is made."""
    make_folder(file.parent)
    if file.is_dir() or (file.exists() and not os.access(file, os.W_OK)):
        raise RunFolderError(f"{file} cannot be written to.")
