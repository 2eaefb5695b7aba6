"""The pages of events, by the calls that report them, and of MAVLink messages, by what reads and makes them."""

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

from bench.reference.markdown import MEANINGS, code, table
from companion.guard.machine import _KINDS
from companion.mavlink import encode, readers
from companion.reflex.classify import TABLE

ROOT = Path(__file__).parents[2]
# What is told under a kind that stands in no call.
ELSEWHERE = frozenset({"late", "lost", "guard", *_KINDS.values()})


def events() -> dict[str, str]:
    told = data_keys()
    rows = [
        (code(kind), meaning, ", ".join(map(code, told.get(kind, ())))) for kind, meaning in MEANINGS["events"].items()
    ]
    impacts = [(row.kind.value, row.criterion) for row in TABLE]
    return {"events": table(("kind", "meaning", "data"), rows), "impacts": table(("kind", "criterion"), impacts)}


def data_keys() -> dict[str, list[str]]:
    """Of each kind that a call in the companion tells the keys of its data."""
    found: dict[str, list[str]] = {}
    for path in sorted((ROOT / "companion").rglob("*.py")):
        for call in _calls(ast.parse(path.read_text(encoding="utf-8"))):
            at = {"report": 1, "Notice": 0}[_name(call)]
            kind = call.args[at] if len(call.args) > at else None
            if isinstance(kind, ast.Constant) and isinstance(kind.value, str):
                keys = found.setdefault(kind.value, [])
                keys += [word.arg for word in call.keywords if word.arg and word.arg not in keys]
    return found


def _calls(tree: ast.AST) -> Iterator[ast.Call]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and _name(node) in ("report", "Notice"):
            yield node


def _name(call: ast.Call) -> str:
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def messages() -> dict[str, str]:
    read = [(code(name), ", ".join(map(code, reader._names))) for name, reader in sorted(readers._BY_NAME.items())]
    return {"received": table(("message", "fields"), read), "sent": ", ".join(map(code, sorted(_sent())))}


def _sent() -> set[str]:
    """By pymavlink's encoders and classes that the encoder names."""
    found = re.findall(r"\.(?:MAVLink_(\w+)_message|(\w+)_encode)\b", inspect.getsource(encode))
    return {(of_class or of_call).upper() for of_class, of_call in found}
