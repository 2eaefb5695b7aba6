"""The tables of what a person writes, from the JSON schemas of the models that read it: a row a key."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel

from companion.guard.config import GuardConfig
from companion.mission.config import CompanionConfig
from companion.mission.model import Mission
from rebound_cli.check.schema import DescribedSchema
from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.scene import Scene

COMPANION = {"CompanionConfig": "[keys of their own](companion.md)"}
OF_A_MISSION = dict.fromkeys(("Fence", "SetpointLimits", "RecoveryConfig"), "[as in a mission](mission.md)")
Schema = Mapping[str, Any]
HEADS = ("key", "value", "default", "meaning")
_KINDS = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false", "object": "map"}


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """In Markdown, as narrow as it can be: a changed cell changes its own line alone."""
    lines = ["| " + " | ".join(_cell(part) for part in row) + " |" for row in rows]
    return "\n".join(["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads), *lines]) + "\n"


def _cell(text: object) -> str:
    """One line without a bar; what looks like a tag is none."""
    parts = re.split(r"(`[^`]*`)", " ".join(str(text).split()))
    plain = (part if part.startswith("`") else part.replace("<", "&lt;") for part in parts)
    return re.sub(r"(?<!\\)\|", r"\\|", "".join(plain))


def code(text: object) -> str:
    return f"`{text}`" if str(text) else ""


def mission() -> dict[str, str]:
    return {"keys": table(HEADS, Keys(Mission, COMPANION).rows())}


def companion() -> dict[str, str]:
    return {"keys": _short_table(Keys(CompanionConfig))}


def guard() -> dict[str, str]:
    return {"keys": _short_table(Keys(GuardConfig, COMPANION | OF_A_MISSION))}


def _short_table(keys: "Keys") -> str:
    """What a key is; what follows in its docstring says why."""
    sentence = re.compile(r"(?<=\.)\s+(?=[A-Z`0-9])")
    return table(HEADS, ((*row[:-1], sentence.split(row[-1], maxsplit=1)[0]) for row in keys.rows()))


def world() -> dict[str, str]:
    whole = Keys(Scene)
    faults = whole.choices(whole.schema["properties"]["faults"])
    keys = Keys(Scene, dict.fromkeys(faults, "[kinds below](#faults)"))
    kinds = table(HEADS, (row for name in faults for row in keys.fault_rows(name)))
    return {"keys": table(HEADS, keys.rows()), "faults": kinds}


def airframe() -> dict[str, str]:
    """With both built-in airframes' values instead of bounds; sensors have some keys in common."""
    first, second = (load_built_in(name).model_dump() for name in ("foldable", "rigid"))
    rows, said = [], {""}
    for key, meaning in Keys(Airframe).meanings():
        one, other = (code(json.dumps(_value(data, key))) for data in (first, second))
        if not isinstance(_value(first, key), dict):
            values = one if one == other else f"{one}, rigid {other}"
            rows.append((code(key), values, "the same" if meaning in said and meaning else meaning))
            said.add(meaning)
    return {"keys": table(("key", "foldable", "meaning"), rows)}


def _value(data: Any, path: str) -> Any:
    for part in path.split("."):
        data = data[part] if isinstance(data, dict) and part in data else None
    return data


class Keys:
    """The keys of a file, each with its path. `elsewhere`: of models that other tables have, what stands instead."""

    def __init__(self, model: type[BaseModel], elsewhere: Mapping[str, str] | None = None) -> None:
        self.schema = model.model_json_schema(by_alias=True, schema_generator=DescribedSchema)
        if "$ref" in self.schema:  # a model that leads to itself
            self.schema = {**self.schema["$defs"][model.__name__], "$defs": self.schema["$defs"]}
        self._elsewhere = dict(elsewhere or {})

    def rows(self) -> Iterator[tuple[str, ...]]:
        shown = dict(self._elsewhere)
        for key, prop, required in self._walked(self.schema, "", shown):
            yield self._row(key, prop, required, shown)

    def meanings(self) -> Iterator[tuple[str, str]]:
        return ((key, self._meaning(prop)) for key, prop, _ in self._walked(self.schema, "", {}))

    def fault_rows(self, name: str) -> Iterator[tuple[str, ...]]:
        """Of one kind of fault: without its times, which all have."""
        part = self.schema["$defs"][name]
        kind = part["properties"]["kind"]["const"]
        yield code(kind), "", "", part["description"].partition("\n")[0]
        for key, prop, required in self._walked(part, f"{kind}.", {}):
            if key.rpartition(".")[2] not in ("kind", "at_s", "between_s"):
                yield self._row(key, prop, required, {})

    def choices(self, prop: Schema) -> list[str]:
        """The names of the models that a value may be, of a list its entries."""
        parts = [prop, *prop.get("anyOf", ()), *prop.get("oneOf", ())]
        inner = [part["items"] for part in parts if isinstance(part.get("items"), dict)]
        own = [part["$ref"].rpartition("/")[2] for part in parts if "$ref" in part]
        return own + [name for part in inner for name in self.choices(part)]

    def _walked(self, part: Schema, at: str, shown: dict[str, str]) -> Iterator[tuple[str, Schema, bool]]:
        """Depth first. A model's keys stand below the first key that leads to it."""
        for name, prop in part["properties"].items():
            yield f"{at}{name}", prop, name in part.get("required", ())
            for model in self.choices(prop):
                if model not in shown:
                    shown[model] = f"as `{at}{name}`"
                    yield from self._walked(self.schema["$defs"][model], f"{at}{name}.", shown)

    def _row(self, key: str, prop: Schema, required: bool, shown: Mapping[str, str]) -> tuple[str, ...]:
        value = prop.get("default")
        default = "" if value is None or isinstance(value, dict) or value == [] else code(json.dumps(value))
        return code(key), self._type(prop, shown), "required" if required else default, self._meaning(prop)

    def _type(self, prop: Schema, shown: Mapping[str, str]) -> str:
        """In words."""
        for word in ("anyOf", "oneOf", "allOf"):
            if word in prop:
                parts = [self._type(part, shown) for part in prop[word] if part.get("type") != "null"]
                return " or ".join(dict.fromkeys(parts))
        if "$ref" in prop:
            return shown.get(prop["$ref"].rpartition("/")[2], "map")
        if "enum" in prop:
            return " or ".join(code(value) for value in prop["enum"])
        if "const" in prop:
            return code(json.dumps(prop["const"]))
        if prop.get("type") == "array":
            inner = self._type(prop.get("items") or (prop.get("prefixItems") or [{}])[0], shown)
            count = prop.get("maxItems") if prop.get("maxItems") == prop.get("minItems") else None
            return f"{count} {inner.replace('number', 'numbers', 1)}" if count else f"list of {inner}"
        return f"{_KINDS.get(str(prop.get('type')), 'map')}{_bounds(prop)}"

    def _meaning(self, prop: Schema) -> str:
        """The key's docstring, or the first line of its model's."""
        models = self.choices(prop)
        own = self.schema["$defs"][models[0]].get("description", "") if len(models) == 1 else ""
        return str(prop.get("description") or own.partition("\n")[0])


def _bounds(prop: Schema) -> str:
    """As an interval; coordinates, whose bounds are those of any number that is no mistake, without."""
    least, most = prop.get("minimum", prop.get("exclusiveMinimum")), prop.get("maximum", prop.get("exclusiveMaximum"))
    if (least is None and most is None) or (least, most) == (-100_000, 100_000):
        return ""
    if most is None:
        return f" {'≥' if 'minimum' in prop else '>'} {least:g}"
    return f" in {'[' if 'minimum' in prop else '('}{least:g}, {most:g}{']' if 'maximum' in prop else ')'}"
