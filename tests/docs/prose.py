"""Sentences of Markdown and how long they are."""

import re

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


def lengths(text):
    """Of its sentences, in words. A table's cells are short and would make the mean look better than the prose is."""
    prose = "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("|"))
    return [len(words(sentence)) for sentence in sentences(prose)]
