"""Pages of what stands in files already: missions that ship, MAVLink messages, parameters."""

import ast
import csv
import inspect
from pathlib import Path

import yaml

from bench.reference.markdown import code, table
from companion.mavlink import encode, readers
from sim_vehicle.parameters.definitions import TABLE

ROOT = Path(__file__).parents[2]
_OBSTACLES = {"walls": "wall", "poles": "pole", "boxes": "box"}


def missions_page() -> str:
    text = (
        "# Missions that ship\n\n`rebound fly NAME --lockstep` flies one. The tests fly each of them. Those without an "
    )
    text += "obstacle fly on a real\nPX4 with only the address changed.\n\n"
    rows = []
    for path in sorted((ROOT / "missions").glob("*.yaml")):
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
        counts = {kind: len(data.get("sim", {}).get(kind, ())) for kind in _OBSTACLES}
        placed = [f"{count} {_OBSTACLES[kind] if count == 1 else kind}" for kind, count in counts.items() if count]
        rows.append((code(path.name), data["description"], ", ".join(placed) or "none"))
    return text + table(("file", "what it flies", "obstacles"), rows)


def messages_page() -> str:
    """What the companion hears, from the readers; what it sends, from the encoder's own calls."""
    text = (
        "# MAVLink messages of the companion\n\n## Heard\n\n`companion/mavlink/readers.py` reads these fields and no "
    )
    text += "others.\n\n"
    heard = [(code(name), ", ".join(code(field) for field in reader._names)) for name, reader in _readers()]
    text += table(("message", "fields"), heard)
    text += "\n## Sent\n\n`companion/mavlink/encode.py` makes these.\n\n"
    tree = ast.parse(inspect.getsource(encode))
    sent = {
        node.func.attr.removesuffix("_encode").upper()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr.endswith("_encode")
    }
    sent |= {
        node.attr.removeprefix("MAVLink_").removesuffix("_message").upper()
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr.startswith("MAVLink_") and node.attr.endswith("_message")
    }
    return text + "".join(f"- `{name}`\n" for name in sorted(sent))


def _readers() -> list[tuple[str, readers.Reader]]:
    return sorted(readers._BY_NAME.items())


def parameters_page() -> str:
    text = "# Parameters of the simulated vehicle\n\nPX4's names, types, units, defaults and ranges. "
    text += (
        "`sim_vehicle/parameters/px4.csv` is the source.\nThe airframe's own values stand in place of some defaults "
    )
    text += "(`sim_vehicle/parameters/airframe_values.py`).\n\n"
    with TABLE.open(encoding="utf-8", newline="") as file:
        rows = [
            (code(row["name"]), row["type"], row["default"], row["min"], row["max"], row["unit"], row["needs_reboot"])
            for row in csv.DictReader(file)
        ]
    return text + table(("name", "type", "default", "least", "most", "unit", "after a reboot"), rows)
