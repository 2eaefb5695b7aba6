"""The missions that ship with the program, by their names."""

import contextlib
import importlib.resources
from pathlib import Path


def shipped_missions() -> dict[str, Path]:
    """Without the package of missions, none."""
    with contextlib.suppress(ModuleNotFoundError):
        folder = Path(str(importlib.resources.files("rebound_missions")))
        return {path.stem: path for path in sorted(folder.glob("*.yaml"))}
    return {}
