"""Markdown that several generated pages have in common, and what people have written of keys and events."""

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import yaml

MEANINGS: dict[str, dict[str, str]] = yaml.safe_load(Path(__file__).with_name("meanings.yaml").read_text("utf-8"))


def cell(text: object) -> str:
    """One line without a bar, as a table's cell must be; what looks like a tag is none."""
    parts = re.split(r"(`[^`]*`)", " ".join(str(text).split()))
    plain = (part if part.startswith("`") else part.replace("<", "&lt;") for part in parts)
    return re.sub(r"(?<!\\)\|", r"\\|", "".join(plain))


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table; empty where there is no row."""
    lines = ["| " + " | ".join(cell(part) for part in row) + " |" for row in rows]
    if not lines:
        return ""
    return "\n".join(["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads), *lines]) + "\n"


def code(text: object) -> str:
    return f"`{text}`" if str(text) else ""


def first_sentence(text: str) -> str:
    """What a key or a function is; what follows says why."""
    return re.split(r"(?<=\.)\s+(?=[A-Z`0-9])", text, maxsplit=1)[0]


def once(rows: Iterable[tuple[str, ...]]) -> Iterator[tuple[str, ...]]:
    """Each meaning, the last cell, once: sensors have some keys in common, and vehicles some methods."""
    said: set[str] = set()
    for *cells, meaning in rows:
        yield (*cells, "the same" if meaning and meaning in said else meaning)
        said.add(meaning)
