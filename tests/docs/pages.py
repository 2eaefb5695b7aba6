"""The pages of the manual, and what stands in them."""

import re
from pathlib import Path

from bench.reference.command import PAGES

ROOT = Path(__file__).parents[2]
# Tables of names, which no reader reads from end to end; the reference has a limit of its own.
TABLES = {f"docs/reference/{name}" for name in (*PAGES, "events.md", "python-api.md", "summary.md")}
_BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)


def name_of(path):
    return path.relative_to(ROOT).as_posix()


def manual():
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


def by_hand():
    """Those of them that people write."""
    return [path for path in manual() if name_of(path) not in TABLES]


def blocks(path):
    found = _BLOCK.findall(path.read_text(encoding="utf-8"))
    return [(language, re.sub(f"^{indent}", "", text, flags=re.MULTILINE)) for indent, language, text in found]
