"""What a drone does without, and the extra that brings it."""

EXTRAS = dict.fromkeys(("numba", "pygeomag", "matplotlib"), "sim")
EXTRAS |= {"pyulog": "logs", "mcap": "logs", "mavsdk": "mavsdk", "pandas": "bench"}


def needed_text(error: ModuleNotFoundError) -> str:
    """What to install. Raises the error itself where no extra brings the module."""
    package = (error.name or "").partition(".")[0]
    extra = EXTRAS.get(package)
    if extra is None:
        raise error
    return f"this needs {package}: pip install 'px4-rebound[{extra}]'."
