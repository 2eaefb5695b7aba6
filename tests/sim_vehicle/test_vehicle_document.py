"""The simulated vehicle's page names tests that exist, and its parameters are such as somebody needs."""

import re
from pathlib import Path

from sim_vehicle.parameters.definitions import TABLE, definitions

ROOT = Path(__file__).parents[2]
DOCUMENT = (ROOT / "docs" / "reference" / "simulated-vehicle.md").read_text()
# Where the document's file names begin.
FOLDERS = (ROOT / "tests/sim_vehicle", ROOT / "tests/sim_vehicle/autopilot", ROOT / "tests")
_HEADINGS = ("test", "as PX4")
# What follows is no table of what is supported.
_LAST_SECTION = "## Clients"


def rows() -> list[list[str]]:
    """The cells of every table's rows, without its heading."""
    supported = DOCUMENT[: DOCUMENT.index(_LAST_SECTION)]
    lines = [line.strip("|").split(" | ") for line in supported.splitlines() if line.startswith("| ")]
    return [cells for cells in lines if cells[-1].strip() not in _HEADINGS]


def test_every_row_names_a_test_and_every_test_exists():
    defined = {
        name
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r"^def (test_\w+)", path.read_text(), re.M)
    }
    assert len(rows()) > 60
    for cells in rows():
        named = re.findall(r"`([\w./]+)`", cells[-1])
        assert named, f"no test: {cells}"
        for name in named:
            if name.startswith("test_") and not name.endswith(".py"):
                assert name in defined, name
            else:
                assert any((folder / name).exists() for folder in FOLDERS), name


def code() -> str:
    paths = [path for package in ("sim_vehicle", "rebound_cli") for path in (ROOT / package).rglob("*.py")]
    return "\n".join(path.read_text() for path in paths)


def test_every_parameter_steers_the_vehicle_or_is_asked_for_by_clients():
    # Given what the document lists as asked for by name
    (listed,) = [cells[0] for cells in rows() if "ask for them by name" in cells[1]]
    asked_for = set(re.findall(r"`(\w+)`", listed))
    read = code()
    unread = {name for name in definitions() if not re.search(rf"[\"']{name}[\"']", read)}
    assert unread == asked_for, f"in {TABLE.name}, but nothing reads them"
