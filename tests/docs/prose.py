"""Sentences of Markdown and how long they are: `python -m tests.docs.prose FILE...`, or of the whole manual."""

import re
import statistics
import sys
from dataclasses import dataclass
from pathlib import Path

from tests.docs.pages import by_hand

# What is no prose: code, comments, pictures, marks of tables and lists, addresses of links.
_LEFT_OUT = (
    (re.compile(r"^ *```.*?^ *```$", re.MULTILINE | re.DOTALL), "\n\n"),
    (re.compile(r"<!--.*?-->", re.DOTALL), ""),
    (re.compile(r"^    .*$", re.MULTILINE), ""),
    (re.compile(r"^#+ .*$", re.MULTILINE), "\n"),
    (re.compile(r"!\[[^]]*\]\([^)]*\)"), ""),
    (re.compile(r"\[([^]]*)\]\([^)]*\)"), r"\1"),
    (re.compile(r"`[^`\n]*`"), "`code`"),
)
_ITEM = re.compile(r"^ *(?:[-*]|\d+\.) ", re.MULTILINE)
# A full stop that ends a sentence is followed by a space and a capital, a digit or a quotation.
_END = re.compile(r"(?<=[.!?])\**\s+(?=[\"'(*`]*[A-Z0-9`])|(?<=:)\s*\n\s*\n|\n\s*\n")
LONG = 30


@dataclass(frozen=True)
class Figures:
    sentences: int
    mean: float
    long_share: float


def plain(text):
    """The prose of a page, a row of a table a paragraph a cell."""
    for pattern, instead in _LEFT_OUT:
        text = pattern.sub(instead, text)
    lines = [
        line if not line.startswith("|") else "\n\n".join(re.split(r"(?<!\\)\|", line)) + "\n"
        for line in text.splitlines()
        if not re.fullmatch(r"[|\-: ]+", line)
    ]
    return _ITEM.sub("\n\n", "\n".join(lines))


def sentences(text):
    """Each with two words or more."""
    found = (" ".join(part.split()) for part in _END.split(plain(text)) if part)
    return [part for part in found if len(words(part)) > 1]


def words(sentence):
    return re.findall(r"\w[\w'’.,/%-]*", sentence)


def figures(texts):
    lengths = [len(words(sentence)) for text in texts for sentence in sentences(without_tables(text))]
    return Figures(len(lengths), statistics.mean(lengths), sum(length > LONG for length in lengths) / len(lengths))


def without_tables(text):
    """Cells are short and would make the mean look better than the prose is."""
    return "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("|"))


def main(names):
    paths = [Path(name) for name in names] or by_hand()
    texts = [path.read_text(encoding="utf-8") for path in paths]
    found = figures(texts)
    count = sum(len(text.split()) for text in texts)
    print(f"{len(paths)} pages, {count} words; {found.sentences} sentences of {found.mean:.1f} words, ", end="")
    print(f"{100 * found.long_share:.1f} % over {LONG}")


if __name__ == "__main__":
    main(sys.argv[1:])
