"""The pages of what a person writes, from the models that read it."""

import ast
import functools
import inspect
import json
import tokenize
from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from textwrap import dedent
from types import UnionType
from typing import Any, get_args

import yaml
from pydantic import BaseModel

from bench.reference.markdown import code, table
from companion.fence import Fence
from companion.guard.config import GuardConfig
from companion.mission.config import CompanionConfig
from companion.mission.model import Mission
from companion.mission.policy import SetpointLimits
from companion.reflex.config import RecoveryConfig
from rebound_cli.check.schema import key_docstrings
from sim_vehicle.airframe import BUILT_IN_FOLDER, Airframe, load_built_in
from sim_vehicle.faults.spec import Fault
from sim_vehicle.scene import Scene

Model = type[BaseModel]


def mission_page() -> str:
    head = "# Mission keys\n\nEvery key of a mission file. [Write a mission](../how-to/missions.md) shows how they are "
    head += "used.\nPositions are metres north, east and down of the arming position.\n\n"
    return head + _sections(Mission, {CompanionConfig: "[companion](companion.md)"})


def companion_page() -> str:
    head = "# Companion keys\n\nThe `companion:` part of a mission, of a guard's file and of `--companion FILE`. Every "
    head += "key is optional.\n\n"
    return head + _sections(CompanionConfig)


def guard_page() -> str:
    head = "# Guard keys\n\nThe file of `rebound guard --config`. Every key is optional. `fence`, `limits`, `recovery` "
    head += "and\n`companion` mean what they do in a [mission](mission.md).\n\n"
    shared: dict[Model, str] = {CompanionConfig: "[companion](companion.md)"}
    shared |= {Fence: "[fence](mission.md#fence)", SetpointLimits: "[limits](mission.md#limits)"}
    shared |= {RecoveryConfig: "[recovery](mission.md#recovery)"}
    return head + _sections(GuardConfig, shared)


def world_page() -> str:
    head = "# World keys\n\nThe `sim:` part of a mission file: what the simulated vehicle flies in. A flight with "
    head += (
        "`--connect` ignores it.\nPositions are metres in the world, whose origin is the vehicle's default start.\n\n"
    )
    text = head + _sections(Scene, dict.fromkeys(_faults(), "[faults](#faults)"))
    text += "## Faults\n\nEach entry of `faults` has a `kind` and a time: `at_s` or `between_s`, in seconds of the "
    text += "vehicle's boot clock.\n\n"
    return text + "".join(_section(model, "### " + _kind(model), {}) for model in _faults())


def airframe_page() -> str:
    """With both built-in airframes' values, and what the file of the first says about each."""
    text = (
        "# Airframe keys\n\nA file states what differs from a built-in airframe: `based_on: foldable` or `rigid`. SI "
    )
    text += "units; body axes\nforward, right, down. The last column is the comment in "
    text += "`sim_vehicle/airframes/foldable.yaml`.\n\n"
    first, second = (load_built_in(name).model_dump() for name in ("foldable", "rigid"))
    said = _yaml_comments((BUILT_IN_FOLDER / "foldable.yaml").read_text(encoding="utf-8"))
    places: list[tuple[Model, str]] = [(Airframe, ""), *_placed(Airframe, "")]
    for model, at in places:
        rows = []
        for name, meaning in _notes(model).items():
            path = f"{at}{name}"
            if isinstance(_value(first, path), dict):
                continue
            values = [code(json.dumps(_value(data, path))) for data in (first, second)]
            rows.append((code(path), *values, meaning, said.get(path, "")))
        text += f"## {at.rstrip('.') or 'The vehicle'}\n\n{_doc(model)}\n\n"
        text += table(("key", "foldable", "rigid", "meaning", "source"), rows) + "\n"
    return text


def world_links() -> Mapping[str, str]:
    """Of each model of a world by its name the address of its section."""
    return {model.__name__: f"world.md#{_anchor(path)}" for model, path in _paths(Scene, _faults()).items()}


def _sections(top: Model, elsewhere: Mapping[Model, str] | None = None) -> str:
    """The keys of a file, then those of each key that is a map, under its path. `elsewhere`: links to other pages."""
    paths = _paths(top, tuple(elsewhere or {}))
    links = {model.__name__: link for model, link in (elsewhere or {}).items()}
    links |= {model.__name__: f"[{path}](#{_anchor(path)})" for model, path in paths.items()}
    text = _section(top, "## All keys", links)
    return text + "".join(_section(model, f"## {path}", links) for model, path in paths.items())


def _anchor(path: str) -> str:
    """As GitHub and MkDocs make it of a heading."""
    return path.replace(".", "")


def _section(model: Model, heading: str, links: Mapping[str, str]) -> str:
    """A heading, the model's docstring and a row a key."""
    schema = model.model_json_schema(by_alias=True)
    if "$ref" in schema:  # a model that leads to itself
        schema = schema["$defs"][model.__name__]
    notes = _notes(model)
    rows = []
    for field_name, field in model.model_fields.items():
        key = field.alias or field_name
        if key == "kind":
            continue
        kind = _type(schema["properties"][key], links)
        default = "" if field.is_required() else _default(field.get_default(call_default_factory=True))
        inner = next(_models(field.annotation), None)
        meaning = notes.get(field_name) or (_doc(inner).partition("\n")[0] if inner else "")
        rows.append((code(key), kind, default, meaning))
    return (
        f"{heading}\n\n{_doc(model)}\n\n" + table(("key", "value", "default", "meaning"), rows) + ("\n" if rows else "")
    )


def _default(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, BaseModel):
        return ""
    return code(json.dumps(value)) if value != () else "none"


def _type(prop: Mapping[str, Any], links: Mapping[str, str]) -> str:
    """In words, from JSON schema; a model's name leads to its section."""
    for word in ("anyOf", "oneOf", "allOf"):
        if word in prop:
            parts = [_type(part, links) for part in prop[word] if part.get("type") != "null"]
            return " or ".join(dict.fromkeys(parts))
    if "$ref" in prop:
        return links[prop["$ref"].rpartition("/")[2]]
    if "enum" in prop:
        return " or ".join(code(value) for value in prop["enum"])
    if "const" in prop:
        return code(prop["const"])
    if prop.get("type") == "array":
        inner = prop.get("items") or (prop.get("prefixItems") or [{}])[0]
        count = prop.get("maxItems") if prop.get("maxItems") == prop.get("minItems") else None
        return f"list of {count or ''} {_type(inner, links)}".replace("  ", " ")
    words = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false"}
    text = words.get(str(prop.get("type")), "map")
    least = ("minimum", "from") if "minimum" in prop else ("exclusiveMinimum", "above")
    bounds = (least, ("exclusiveMaximum", "below"), ("maximum", "to"))
    return " ".join([text, *(f"{word} {prop[name]:g}" for name, word in bounds if name in prop)])


def _doc(model: Model) -> str:
    text = inspect.getdoc(model) or ""
    return "" if text == inspect.getdoc(BaseModel) else text


def _paths(top: Model, stop: Sequence[Model] = (), at: str = "") -> dict[Model, str]:
    """Every model that the keys of this one lead to, with the shortest path of keys."""
    own: dict[Model, str] = {}
    for name, field in top.model_fields.items():
        for inner in _models(field.annotation):
            if inner not in stop and inner is not top:
                own.setdefault(inner, f"{at}{field.alias or name}")
    found: dict[Model, str] = {}
    for inner, path in own.items():
        found[inner] = path
        found |= _paths(inner, (*stop, *own, *found, top), f"{path}.")
    return found


def _models(annotation: Any) -> Iterator[Model]:
    if isinstance(annotation, type) and not isinstance(annotation, UnionType) and not get_args(annotation):
        if issubclass(annotation, BaseModel):
            yield annotation
    else:
        for part in get_args(annotation):
            yield from _models(part)


def _placed(model: Model, at: str) -> Iterator[tuple[Model, str]]:
    """The same with the path of keys that leads to each."""
    for name, field in model.model_fields.items():
        for inner in _models(field.annotation):
            yield inner, f"{at}{name}."
            yield from _placed(inner, f"{at}{name}.")


@functools.cache
def _faults() -> tuple[Model, ...]:
    return tuple(_models(Fault))


def _kind(model: Model) -> str:
    (kind,) = get_args(model.model_fields["kind"].annotation)
    return str(kind)


@functools.cache
def _notes(model: Model) -> Mapping[str, str]:
    """Of each field its docstring, or the comment before it; a base class's, too."""
    found: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if base is not BaseModel and isinstance(base, type) and issubclass(base, BaseModel):
            found |= _own_notes(base)
    return {name: found.get(name, "") for name in model.model_fields}


def _own_notes(model: Model) -> dict[str, str]:
    source = dedent(inspect.getsource(model))
    comments = {
        token.start[0]: token.string.lstrip("# ")
        for token in tokenize.generate_tokens(StringIO(source).readline)
        if token.type == tokenize.COMMENT
    }
    (body,) = (node.body for node in ast.parse(source).body if isinstance(node, ast.ClassDef))
    found = {}
    for node in body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            first = node.lineno
            while first - 1 in comments:
                first -= 1
            found[node.target.id] = " ".join(comments[line] for line in range(first, node.lineno))
    return found | {name: " ".join(text.split()) for name, text in key_docstrings(model).items()}


def _value(data: Any, path: str) -> Any:
    for part in path.split("."):
        data = data[part] if isinstance(data, dict) and part in data else None
    return data


def _yaml_comments(text: str) -> dict[str, str]:
    """Of each key of a YAML file of nested maps the comment beside it, or the lines of comment before it."""
    found: dict[str, str] = {}
    keys: list[tuple[int, str]] = []
    before: list[str] = []
    for line in text.splitlines():
        stripped, indent = line.strip(), len(line) - len(line.lstrip())
        if stripped.startswith("#"):
            before.append(stripped.lstrip("# "))
            continue
        name, colon, rest = stripped.partition(":")
        if not colon:
            before = []
            continue
        keys = [*((depth, key) for depth, key in keys if depth < indent), (indent, name)]
        path = ".".join(key for _, key in keys)
        beside = rest.partition("#")[2].strip()
        found[path] = " ".join([*before, beside]).strip()
        inner = yaml.safe_load(rest.partition("#")[0]) if rest.strip().startswith("{") else None
        if isinstance(inner, dict):
            found |= {f"{path}.{key}": found[path] for key in inner}
        before = []
    return found
