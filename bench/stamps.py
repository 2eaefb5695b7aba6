"""Stamps: every picture and figure of the manual says by which command it was made, on which version of which files.

A stamp is a sentence such as

    Measured by `rebound fly wall --lockstep` on version 0.1.0+0123456789abcdef of `companion`, `sim_vehicle`.

Its digits are a digest of the code and the data in the files and folders that it names. Comments and docstrings do not
count, and neither does the release. A stamp with another digest than the files have now is out of date. In the manual
each section with a picture has one. What a study writes into `build/` begins with one, too.
"""

import ast
import hashlib
import re
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from rebound_cli import __version__

ROOT = Path(__file__).parents[1]
_STAMP = re.compile(
    r"Measured\s+by\s+`(?P<command>[^`]+)`\s+on\s+version\s+(?P<version>[\w.+-]+)\s+of\s+"
    r"(?P<paths>`[^`]+`(?:,\s+`[^`]+`)*)"
)
FLOWN = ("companion", "sim_vehicle")
# Files that a result depends on beside the code.
_DATA = (".yaml", ".csv", ".js", ".css", ".html")
_DIGITS = 16
_PICTURE = re.compile(r"!\[[^]]*\]\(")


@dataclass(frozen=True, slots=True)
class Stamp:
    """The command that measured something, on which version, and the files and folders that it depends on."""

    command: str
    version: str
    paths: tuple[str, ...]

    @property
    def is_old(self) -> bool:
        return digest(self.paths) != self.version.partition("+")[2]


def stamp_text(command: str, paths: Sequence[str] = FLOWN) -> str:
    """The sentence of a stamp made now, without its full stop. Most studies fly all of both programs."""
    named = ", ".join(f"`{path}`" for path in paths)
    return f"Measured by `{command}` on version {__version__}+{digest(paths)} of {named}"


def digest(paths: Sequence[str]) -> str:
    """Of all code and data in these files and folders of the checkout."""
    found = hashlib.sha256()
    for path in paths:
        files = sorted((ROOT / path).rglob("*")) if (ROOT / path).is_dir() else [ROOT / path]
        for file in files:
            if file.suffix in _DATA:
                found.update(file.relative_to(ROOT).as_posix().encode() + file.read_bytes())
            elif file.suffix == ".py":
                code = _meaning(ast.parse(file.read_text(encoding="utf-8")))
                found.update(f"{file.relative_to(ROOT).as_posix()} {code}".encode())
    return found.hexdigest()[:_DIGITS]


def _meaning(value: object) -> object:
    """A syntax tree as nested tuples, the same for every version of Python: without strings that stand alone."""
    if isinstance(value, list):
        return tuple(_meaning(one) for one in value if not _is_remark(one))
    if not isinstance(value, ast.AST):
        return value
    fields = ((name, _meaning(one)) for name, one in ast.iter_fields(value))
    return (type(value).__name__, *((name, one) for name, one in fields if one not in ((), None)))


def _is_remark(node: object) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def stamps_in(text: str) -> list[Stamp]:
    found = _STAMP.finditer(text)
    return [Stamp(one["command"], one["version"], tuple(re.findall(r"`([^`]+)`", one["paths"]))) for one in found]


def complaints(name: str, text: str) -> Iterator[str]:
    """What is wrong with the stamps of one page."""
    for stamp in stamps_in(text):
        if stamp.is_old:
            yield f"{name}: measured on {stamp.version}, which is older than the code: run `{stamp.command}`"
    for section in re.split(r"^#+ ", text, flags=re.MULTILINE):
        if _PICTURE.search(section) and not stamps_in(section):
            yield f"{name}: the section {section.partition(chr(10))[0]!r} has a picture without a stamp"


def stamped_anew(text: str, command: str) -> str:
    """With what this command has just measured or drawn again."""

    def anew(old: re.Match[str]) -> str:
        (stamp,) = stamps_in(old[0])
        return stamp_text(command, stamp.paths) if stamp.command == command else old[0]

    return _STAMP.sub(anew, text)


def run_stamps(options: Namespace) -> int:
    """0, or with --release 1 where a stamp is old or missing."""
    found = [
        complaint
        for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
        for complaint in complaints(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8"))
    ]
    print("\n".join(found) or "Every picture and figure of the manual is as new as its code.")
    return 1 if found and options.release else 0
