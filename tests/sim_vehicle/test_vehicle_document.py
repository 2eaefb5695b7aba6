"""The simulated vehicle's parameters are such as somebody needs, and its page says which of them nothing reads."""

import re
from fnmatch import fnmatch
from pathlib import Path

from sim_vehicle.parameters.store import TABLE, definitions

ROOT = Path(__file__).parents[2]
DOCUMENT = (ROOT / "docs" / "reference" / "simulated-vehicle.md").read_text()


def code() -> str:
    paths = [path for package in ("sim_vehicle", "rebound_cli") for path in (ROOT / package).rglob("*.py")]
    return "\n".join(path.read_text() for path in paths)


def test_every_parameter_steers_the_vehicle_or_is_asked_for_by_clients():
    # Given what the page lists as asked for by name
    (listed,) = re.findall(r"^\| asked for by clients alone \| (.*) \|$", DOCUMENT, re.M)
    asked_for, read = re.findall(r"`([\w*]+)`", listed), code()
    unread = {name for name in definitions() if not re.search(rf"[\"']{name}[\"']", read)}
    named = {name for name in definitions() if any(fnmatch(name, pattern) for pattern in asked_for)}
    assert unread == named, f"in {TABLE.name}, but nothing reads them"
