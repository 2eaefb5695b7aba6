"""The page of the Python API, from signatures and docstrings: a row a name, and one a member."""

import dataclasses
import enum
import inspect
from collections.abc import Iterator
from types import ModuleType

from pydantic import BaseModel

import companion.mavsdk
import sim_vehicle.testing
from bench.reference.markdown import code, first_sentence, once, table
from companion.guard.config import GuardConfig
from companion.reflex.collision import CollisionReport
from companion.report import Event

MODULES: tuple[ModuleType, ...] = (companion.mavsdk, sim_vehicle.testing)


HEADS = ("name", "what it is or does")


def api() -> dict[str, str]:
    modules = ""
    for module in MODULES:
        rows = once(row for name in module.__all__ for row in _rows(name, getattr(module, name)))
        modules += f"## {module.__name__}\n\n{inspect.getdoc(module)}\n\n{table(HEADS, rows)}\n"
    values = [*_rows("companion.report.Event", Event), *_rows("CollisionReport", CollisionReport)]
    return {"modules": modules, "values": table(HEADS, values)}


def _rows(name: str, value: object) -> Iterator[tuple[str, str]]:
    doc = first_sentence(inspect.getdoc(value) or "")
    if inspect.ismodule(value):
        yield code(name), doc
        for one, function in vars(value).items():
            if inspect.isfunction(function) and function.__module__ == value.__name__ and _is_own(one):
                yield _function(f"{name}.{one}", function)
    elif not isinstance(value, type):
        yield _function(name, value)
    elif issubclass(value, BaseModel):
        yield code(name), f"{doc} [Its keys]({'guard' if value is GuardConfig else 'world'}.md)."
    elif issubclass(value, enum.Enum):
        yield code(name), f"{doc} " + ", ".join(code(one.name) for one in value) + "."
    elif dataclasses.is_dataclass(value):
        yield code(name), f"{doc} Fields: " + ", ".join(code(field.name) for field in dataclasses.fields(value)) + "."
        yield from _members(name, value)
    elif issubclass(value, Exception):
        yield code(name), doc
    else:
        yield _function(name, value)
        yield from _members(name, value)


def _is_own(name: str) -> bool:
    return name.islower() and not name.startswith("_") and name != "opposite"


def _members(of: str, value: type) -> Iterator[tuple[str, str]]:
    for name, member in vars(value).items():
        if isinstance(member, property) and not name.startswith("_"):
            yield code(f"{of}.{name}"), first_sentence(inspect.getdoc(member) or "")
        elif inspect.isfunction(member) and not name.startswith("_"):
            yield _function(f"{of}.{name}", member)


def _function(name: str, function: object) -> tuple[str, str]:
    return code(f"{name}{_signature(function)}"), first_sentence(inspect.getdoc(function) or "")


def _signature(value: object) -> str:
    """Without annotations."""
    signature = inspect.signature(value)  # type: ignore[arg-type]
    empty = inspect.Parameter.empty
    own = [one.replace(annotation=empty) for one in signature.parameters.values() if one.name != "self"]
    return str(signature.replace(parameters=own, return_annotation=inspect.Signature.empty))
