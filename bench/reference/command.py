"""`bench docs`: writes every generated page, or says which ones are not up to date."""

import argparse
import inspect
import re
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

import bench.main
import rebound_cli.main
from bench.reference import models
from bench.reference.models import code, table
from companion.flight.states import TABLE as FLIGHT
from companion.guard.states import TABLE as GUARD
from companion.mavlink import encode, readers
from companion.state_table import StateTable

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "reference"
MADE_BY = "\n<!-- Written by `make docs`. -->\n"


def mission() -> dict[str, str]:
    """With the missions that ship."""
    shipped = sorted((ROOT / "missions").glob("*.yaml"))
    rows = ((code(path.stem), yaml.safe_load(path.read_text("utf-8"))["description"]) for path in shipped)
    return models.mission() | {"missions": table(("name", "what it flies"), rows)}


def commands() -> dict[str, str]:
    return {
        "commands": table(("command", "does", "more"), _commands(rebound_cli.main.build_parser())),
        "studies": table(("study", "does", "more"), _commands(bench.main.build_parser())),
    }


def _commands(parser: argparse.ArgumentParser, does: str = "") -> Iterator[tuple[str, str, str]]:
    """Those that run something, each with all words of its name and the page that its description names."""
    if parser.get_default("run") is not None:
        page = re.search(r"docs/([\w/-]+)\.md", parser.description or "")
        yield code(parser.prog), does, f"[{page[1].rpartition('/')[2]}](../{page[1]}.md)" if page else ""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for said in action._choices_actions:
                yield from _commands(action.choices[said.dest], said.help or "")


def messages() -> dict[str, str]:
    """What is sent: by pymavlink's encoders and classes that the encoder names."""
    read = [(code(name), ", ".join(map(code, reader._names))) for name, reader in sorted(readers._BY_NAME.items())]
    found = re.findall(r"\.(?:MAVLink_(\w+)_message|(\w+)_encode)\b", inspect.getsource(encode))
    sent = sorted({(of_class or of_call).upper() for of_class, of_call in found})
    return {"received": table(("message", "fields"), read), "sent": ", ".join(map(code, sent))}


def states() -> dict[str, str]:
    """Diagrams are Mermaid's, which GitHub and the site draw."""
    return {
        "flight_diagram": mermaid_diagram(FLIGHT),
        "flight": transitions(FLIGHT),
        "guard_diagram": mermaid_diagram(GUARD),
        "guard": transitions(GUARD),
    }


def mermaid_diagram(states: StateTable[Any, Any]) -> str:
    """Which state leads to which, each arrow once; a state's words are one name there."""
    names = {state: str(state.value).replace(" ", "_") for state in states.rows}
    arrows = [f"    [*] --> {next(iter(names.values()))}"]
    for state, row in states.rows.items():
        arrows += [f"    {names[state]} --> {names[target]}" for target in row.values() if target is not state]
    arrows += [f"    {names[state]} --> [*]" for state in states.rows if state in states.final]
    return "\n".join(["stateDiagram-v2", *dict.fromkeys(arrows)]) + "\n"


def transitions(states: StateTable[Any, Any]) -> str:
    """A row a trigger and what it leads to, with the states in which it does."""
    sources: dict[tuple[str, str], list[str]] = {}
    for state, row in states.rows.items():
        for trigger, target in row.items():
            sources.setdefault((trigger.value, target.value), []).append(state.value)
    rows = [(trigger, ", ".join(inside), target) for (trigger, target), inside in sources.items()]
    return table(("trigger", "in", "leads to"), rows)


# Of each page, whose text stands in `pages/`, the function that makes what is put in.
PAGES: Mapping[str, Callable[[], dict[str, str]]] = {
    "commands.md": commands,
    "mission.md": mission,
    "companion.md": models.companion,
    "guard.md": models.guard,
    "world.md": models.world,
    "airframe.md": models.airframe,
    "states.md": states,
    "messages.md": messages,
}


def page_text(name: str) -> str:
    """The page as it is to be."""
    text = (Path(__file__).parent / "pages" / name).read_text(encoding="utf-8").format(**PAGES[name]())
    # Below the title, which the site takes from the first line.
    title, rest = text.rstrip().split("\n", 1)
    return f"{title}\n{MADE_BY}{rest}\n"


def run_docs(options: Namespace) -> int:
    """0 when all pages are up to date or written; with --check 1 when one is not."""
    old = [
        name for name in PAGES if not (FOLDER / name).exists() or (FOLDER / name).read_text("utf-8") != page_text(name)
    ]
    for name in old:
        if not options.check:
            (FOLDER / name).write_text(page_text(name), encoding="utf-8")
        print(f"docs/reference/{name} is not up to date: run `make docs`." if options.check else f"Written: {name}.")
    return 1 if old and options.check else 0
