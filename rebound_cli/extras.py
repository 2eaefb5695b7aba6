"""What a drone does without, and the extra that brings it."""

import re
import sys
from collections.abc import Iterator

DISTRIBUTION = "px4-rebound"
EXTRAS = dict.fromkeys(("numba", "pygeomag", "matplotlib"), "sim")
EXTRAS |= {"pyulog": "logs", "mcap": "logs", "mavsdk": "mavsdk", "pandas": "bench", "distributed": "cluster"}


def needed_text(error: ModuleNotFoundError) -> str:
    """What to install. Raises the error itself where no extra brings the module.

    By name, because no index has Rebound: the same words help whoever has a wheel and whoever has a checkout.
    """
    # Takes a quarter of the program's start.
    from importlib import metadata

    package = (error.name or "").partition(".")[0]
    extra = EXTRAS.get(package)
    if extra is None:
        raise error
    try:
        wanted = " ".join(f"'{requirement}'" for requirement in _requirements(extra))
    except metadata.PackageNotFoundError:
        wanted = package
    return f"this needs {package}, of the extra [{extra}]: {sys.executable} -m pip install {wanted}"


def _requirements(extra: str) -> Iterator[str]:
    """With their versions, of the installed program; those of an extra that it brings too."""
    from importlib import metadata

    for requirement in metadata.requires(DISTRIBUTION) or ():
        found = re.fullmatch(r"(.+); extra == .(\w+).", requirement)
        if found is None or found[2] != extra:
            continue
        if inner := re.fullmatch(rf"{DISTRIBUTION}\[(.+)\]", found[1]):
            for name in inner[1].split(","):
                yield from _requirements(name)
        else:
            yield found[1]
