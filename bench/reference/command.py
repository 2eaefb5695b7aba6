"""`bench docs`: writes every generated page, or says which ones are not up to date."""

from argparse import Namespace
from collections.abc import Callable, Mapping
from pathlib import Path

from bench.reference.api import api
from bench.reference.markdown import MEANINGS, code, table
from bench.reference.models import airframe, companion, guard, mission, world
from bench.reference.program import commands, events, messages, states

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "reference"
TEMPLATES = Path(__file__).parent / "pages"


def summary() -> dict[str, str]:
    """The meaning of every key."""
    rows = {name: [(code(key), text) for key, text in keys.items()] for name, keys in MEANINGS.items()}
    return {name: table(("key", "meaning"), rows[name]) for name in ("flight", "collision", "truth")}


# Of each page, whose text stands in `pages/`, the function that makes what is put in.
PAGES: Mapping[str, Callable[[], dict[str, str]]] = {
    "commands.md": commands,
    "mission.md": mission,
    "companion.md": companion,
    "guard.md": guard,
    "world.md": world,
    "airframe.md": airframe,
    "events.md": events,
    "summary.md": summary,
    "states.md": states,
    "messages.md": messages,
    "python-api.md": api,
}
MADE_BY = "\n<!-- Written by `make docs`. -->\n"


def page_text(name: str) -> str:
    """The page as it is to be."""
    text = (TEMPLATES / name).read_text(encoding="utf-8").format(**PAGES[name]())
    # Below the title, which the site takes from the first line.
    title, rest = text.rstrip().split("\n", 1)
    return f"{title}\n{MADE_BY}{rest}\n"


def run_docs(options: Namespace) -> int:
    """0 when all pages are up to date or written; with --check 1 when one is not."""
    worst = 0
    for name in PAGES:
        path, text = FOLDER / name, page_text(name)
        if path.exists() and path.read_text(encoding="utf-8") == text:
            continue
        if options.check:
            print(f"{path.relative_to(ROOT)} is not up to date: run `make docs`.")
            worst = 1
        else:
            path.write_text(text, encoding="utf-8")
            print(f"Written to {path.relative_to(ROOT)}.")
    return worst
