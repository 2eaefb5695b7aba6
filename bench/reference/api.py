"""The page of the Python API, from signatures and docstrings."""

import dataclasses
import enum
import inspect
import re
from collections.abc import Iterator
from types import ModuleType

from pydantic import BaseModel

import companion.mavsdk
import sim_vehicle.testing
from bench.reference.markdown import code, table
from bench.reference.models import world_links
from companion.guard.config import GuardConfig
from companion.report import CollisionReport, Event

MODULES: tuple[ModuleType, ...] = (companion.mavsdk, sim_vehicle.testing)


def api_page() -> str:
    text = "# Python API\n\nWhat other programs import. Everything else may change between versions.\n\n"
    for module in MODULES:
        text += f"## {module.__name__}\n\n{inspect.getdoc(module)}\n\n"
        for name in module.__all__:
            text += _entry(name, getattr(module, name))
    text += "## Values\n\nWhat `CollisionGuard.events` and `CollisionGuard.collisions` hold.\n\n"
    return text + _entry("Event", Event, "companion.report.") + _entry("CollisionReport", CollisionReport)


def _entry(name: str, value: object, prefix: str = "") -> str:
    doc = inspect.getdoc(value) or ""
    head = f"### {prefix}{name}\n\n"
    if inspect.ismodule(value):
        functions = [(one, f) for one, f in vars(value).items() if _is_own(value, one, f)]
        return head + f"{doc}\n\n" + table(("function", "does"), [_function(*each) for each in functions]) + "\n"
    if isinstance(value, type) and issubclass(value, Exception):
        return head + f"{doc}\n\n"
    if isinstance(value, type) and issubclass(value, enum.Enum):
        return head + f"{doc}\n\n" + "".join(f"- `{one.name}`: {one.value}\n" for one in value) + "\n"
    if not isinstance(value, type):
        return head + f"```text\n{name}{_signature(value)}\n```\n\n{doc}\n\n"
    if issubclass(value, BaseModel):
        page = "guard.md" if value is GuardConfig else world_links()[value.__name__]
        return head + f"{doc}\n\nIts fields are [these keys]({page}).\n\n"
    if doc.startswith(f"{value.__name__}("):
        doc = ""  # a dataclass's own
    text = head + (f"{doc}\n\n" if doc else "")
    if dataclasses.is_dataclass(value):
        fields = [(code(field.name), _type(field.type)) for field in dataclasses.fields(value)]
        text += table(("field", "type"), fields) + "\n"
    else:
        text += f"```text\n{name}{_signature(value)}\n```\n\n"
    return text + table(("member", "does"), list(_members(value))) + "\n"


def _is_own(module: ModuleType, name: str, value: object) -> bool:
    return inspect.isfunction(value) and value.__module__ == module.__name__ and name.islower() and name != "opposite"


def _members(value: type) -> Iterator[tuple[str, str]]:
    for name, member in vars(value).items():
        if name.startswith("_"):
            continue
        if isinstance(member, property):
            yield code(name), inspect.getdoc(member) or ""
        elif inspect.isfunction(member):
            yield _function(name, member)


def _function(name: str, function: object) -> tuple[str, str]:
    return code(f"{name}{_signature(function)}"), inspect.getdoc(function) or ""


def _signature(value: object) -> str:
    signature = inspect.signature(value)  # type: ignore[arg-type]
    own = [one.replace(annotation=_annotation(one)) for one in signature.parameters.values() if one.name != "self"]
    return str(signature.replace(parameters=own, return_annotation=inspect.Signature.empty)).replace("'", "")


def _annotation(parameter: inspect.Parameter) -> object:
    return parameter.annotation if isinstance(parameter.annotation, str) else inspect.Parameter.empty


def _type(annotation: object) -> str:
    text = annotation.__name__ if isinstance(annotation, type) else str(annotation)
    return re.sub(r"\b(?:[a-z_]+\.)+(?=\w)", "", text)
