"""The pages of what a person writes, from the JSON schemas of the models that read it: a row a key."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel

from bench.reference.markdown import code, first_sentence, once, table
from companion.guard.config import GuardConfig
from companion.mission.config import CompanionConfig
from companion.mission.model import Mission
from rebound_cli.check.schema import DescribedSchema
from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.scene import Scene

MISSIONS = Path(__file__).parents[2] / "missions"
COMPANION = {"CompanionConfig": "[keys of their own](companion.md)"}
OF_A_MISSION = dict.fromkeys(("Fence", "SetpointLimits", "RecoveryConfig"), "[as in a mission](mission.md)")
Schema = Mapping[str, Any]
HEADS = ("key", "value", "default", "meaning")
_KINDS = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false", "object": "map"}


def mission() -> dict[str, str]:
    """With the missions that ship."""
    shipped = [(code(path.stem), yaml.safe_load(path.read_text("utf-8"))) for path in sorted(MISSIONS.glob("*.yaml"))]
    missions = table(("name", "what it flies"), [(name, data["description"]) for name, data in shipped])
    return {"keys": table(HEADS, Keys(Mission, COMPANION).rows()), "missions": missions}


def companion() -> dict[str, str]:
    return {"keys": _short_table(Keys(CompanionConfig))}


def guard() -> dict[str, str]:
    return {"keys": _short_table(Keys(GuardConfig, COMPANION | OF_A_MISSION))}


def _short_table(keys: "Keys") -> str:
    return table(HEADS, ((*row[:-1], first_sentence(row[-1])) for row in keys.rows()))


def world() -> dict[str, str]:
    whole = Keys(Scene)
    faults = whole.choices(whole.schema["properties"]["faults"])
    keys = Keys(Scene, dict.fromkeys(faults, "[kinds below](#faults)"))
    kinds = table(HEADS, (row for name in faults for row in keys.fault_rows(name)))
    return {"keys": table(HEADS, keys.rows()), "faults": kinds}


def airframe() -> dict[str, str]:
    """With both built-in airframes' values instead of bounds."""
    first, second = (load_built_in(name).model_dump() for name in ("foldable", "rigid"))
    rows = []
    for key, meaning in Keys(Airframe).meanings():
        one, other = (code(json.dumps(_value(data, key))) for data in (first, second))
        if not isinstance(_value(first, key), dict):
            rows.append((code(key), one if one == other else f"{one}, rigid {other}", meaning))
    return {"keys": table(("key", "foldable", "meaning"), once(rows))}


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
            yield code(key), self._type(prop, shown), "required" if required else _default(prop), self._meaning(prop)

    def meanings(self) -> Iterator[tuple[str, str]]:
        return ((key, self._meaning(prop)) for key, prop, _ in self._walked(self.schema, "", {}))

    def fault_rows(self, name: str) -> Iterator[tuple[str, ...]]:
        """Of one kind of fault: without its times, which all have."""
        part = self.schema["$defs"][name]
        kind = part["properties"]["kind"]["const"]
        yield code(kind), "", "", part["description"].partition("\n")[0]
        for key, prop, required in self._walked(part, f"{kind}.", {}):
            if key.rpartition(".")[2] not in ("kind", "at_s", "between_s"):
                yield code(key), self._type(prop, {}), "required" if required else _default(prop), self._meaning(prop)

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


def _default(prop: Schema) -> str:
    value = prop.get("default")
    return "" if value is None or isinstance(value, dict) or value == [] else code(json.dumps(value))


def _value(data: Any, path: str) -> Any:
    for part in path.split("."):
        data = data[part] if isinstance(data, dict) and part in data else None
    return data
