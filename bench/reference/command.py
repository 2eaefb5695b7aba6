"""`bench docs`: writes every generated page, or says which ones are not up to date."""

from argparse import Namespace
from collections.abc import Callable, Mapping
from pathlib import Path

from bench.reference import api, commands, events, messages, models, states, summary

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "reference"

# Of each page the function that makes it.
PAGES: Mapping[str, Callable[[], str]] = {
    "commands.md": commands.commands_page,
    "mission.md": models.mission_page,
    "companion.md": models.companion_page,
    "guard.md": models.guard_page,
    "world.md": models.world_page,
    "airframe.md": models.airframe_page,
    "events.md": events.events_page,
    "summary.md": summary.summary_page,
    "states.md": states.states_page,
    "messages.md": messages.messages_page,
    "python-api.md": api.api_page,
}
MADE_BY = "\n<!-- Written by `make docs`. -->\n"


def page_text(name: str) -> str:
    """The page as it is to be."""
    # Below the title, which the site takes from the first line.
    title, rest = PAGES[name]().rstrip().split("\n", 1)
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
