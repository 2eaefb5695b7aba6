"""`rebound plan import`: the file goes to standard output, the notes beside it."""

import json
import re
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from companion.errors import ConfigurationError
from rebound_cli.documents import parse_document, write_text
from rebound_cli.inputs import mission_from
from rebound_cli.plan.reading import mission_of_plan


def run_import(options: Namespace) -> int:
    path: Path = options.plan
    try:
        plan = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ConfigurationError(f"{path}: not JSON, so no plan of QGroundControl: {error}.") from error
    name = options.name or re.sub(r"[^A-Za-z0-9._-]+", "-", path.stem).strip("-") or "mission"
    try:
        data, notes = mission_of_plan(plan, name)
    except ConfigurationError as error:
        raise ConfigurationError(f"{path}: {error}") from error
    text = mission_yaml(data, f"From {path.name}, a plan of QGroundControl.")
    # What is written can be flown: a plan that leaves its own fence is refused here and not at the field.
    mission_from(parse_document(text, f"the mission from {path}"))
    _write(options.out, text, notes)
    return 0


def mission_yaml(data: dict[str, Any], comment: str) -> str:
    """A mission file as a person would write it: an item a line."""
    lines = [f"# {comment}"]
    for key, value in data.items():
        if key == "items":
            lines += ["", "items:", *[f"  - {_flow(item)}" for item in value], ""]
        else:
            lines.append(f"{key}: {_flow(value)}")
    return "\n".join(lines) + "\n"


def _flow(value: Any) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=1_000_000, allow_unicode=True)
    return text.removesuffix("\n").removesuffix("\n...")


def _write(out: Path | None, text: str, notes: Sequence[str]) -> None:
    for note in notes:
        print(f"note: {note}", file=sys.stderr)
    if out is None:
        print(text, end="")
        return
    write_text(out, text)
    print(f"written to {out}", file=sys.stderr)
