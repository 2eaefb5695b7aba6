"""The missions and examples that ship with the program, by their names."""

from pathlib import Path


def shipped_missions() -> dict[str, Path]:
    return _files_of("rebound_missions", ".yaml")


def shipped_examples() -> dict[str, Path]:
    """Programs, settings, layouts, a checklist."""
    return _files_of("rebound_examples", ".py", ".yaml", ".json", ".xml", ".txt")


def _files_of(package: str, *kinds: str) -> dict[str, Path]:
    """Of the one beside this one, in a wheel as in a checkout."""
    files = sorted((Path(__file__).parents[2] / package).iterdir())
    return {path.stem: path for path in files if path.suffix in kinds and path.stem != "__init__"}
