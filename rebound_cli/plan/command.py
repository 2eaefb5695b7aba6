"""`rebound plan import`: the file goes to standard output, the notes beside it."""

import json
import re
import sys
from argparse import Namespace
from pathlib import Path

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
    # Lists and maps of plain values stand on a line.
    written = yaml.safe_dump(data, sort_keys=False, default_flow_style=None, allow_unicode=True)
    text = f"# From {path.name}, a plan of QGroundControl.\n{written}"
    # What is written can be flown: a plan that leaves its own fence is refused here and not at the field.
    mission_from(parse_document(text, f"the mission from {path}"))
    for note in notes:
        print(f"note: {note}", file=sys.stderr)
    if options.out is None:
        print(text, end="")
    else:
        write_text(options.out, text)
        print(f"written to {options.out}", file=sys.stderr)
    return 0
