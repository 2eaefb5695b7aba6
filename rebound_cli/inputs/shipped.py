"""The missions and examples that ship with the program, by their names."""

import contextlib
from pathlib import Path


def shipped_missions() -> dict[str, Path]:
    return _files_of("rebound_missions", ".yaml")


def shipped_examples() -> dict[str, Path]:
    """Programs, settings, layouts, a checklist."""
    return _files_of("rebound_examples", ".py", ".yaml", ".json", ".xml", ".txt")


def _files_of(package: str, *kinds: str) -> dict[str, Path]:
    """Without the package, none."""
    # Here, because it takes a tenth of the program's start.
    import importlib.resources

    with contextlib.suppress(ModuleNotFoundError):
        folder = Path(str(importlib.resources.files(package)))
        files = (path for path in sorted(folder.iterdir()) if path.suffix in kinds and path.stem != "__init__")
        return {path.stem: path for path in files}
    return {}
