"""`bench docs`: writes every generated page of the reference that is not up to date.

Keys come from the JSON schemas of the models that read them, a row a key; the rest from the programs.
"""

import inspect
import json
import re
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel

from bench.main import STUDIES
from companion.flight.states import TABLE as FLIGHT
from companion.guard.config import GuardConfig
from companion.guard.states import TABLE as GUARD
from companion.mavlink import encode, readers
from companion.mission.config import CompanionConfig
from companion.mission.model import Mission
from rebound_cli.check.schema import DescribedSchema
from rebound_cli.main import TABLE
from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.scene import Scene

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "reference"
MADE_BY = "\n<!-- Written by `make docs`. -->\n"
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


# --- pages


def mission() -> dict[str, str]:
    """With the missions that ship."""
    shipped = sorted((ROOT / "missions").glob("*.yaml"))
    rows = ((code(path.stem), yaml.safe_load(path.read_text("utf-8"))["description"]) for path in shipped)
    keys = table(HEADS, Keys(Mission, COMPANION).rows())
    return {"keys": keys, "missions": table(("name", "what it flies"), rows)}


def commands() -> dict[str, str]:
    return {
        "commands": table(("command", "does", "more"), _commands("rebound", TABLE["commands"])),
        "studies": table(("study", "does", "more"), _commands("python -m bench", STUDIES["commands"])),
    }


def _commands(program: str, commands: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Those that run something, each with all words of its name and the page that it names."""
    for name, told in commands.items():
        if "run" in told:
            page = re.search(r"docs/([\w/-]+)\.md", told["more"])
            link = f"[{page[1].rpartition('/')[2]}](../{page[1]}.md)" if page else ""
            yield code(f"{program} {name}"), told["does"], link
        yield from _commands(f"{program} {name}", told.get("commands", {}))


def messages() -> dict[str, str]:
    """What is sent: by pymavlink's encoders and classes that the encoder names."""
    read = sorted((code(one.name), ", ".join(map(code, one._names))) for one in readers.GUARD_READERS.values())
    found = re.findall(r"\.(?:MAVLink_(\w+)_message|(\w+)_encode)\b", inspect.getsource(encode))
    sent = sorted({(of_class or of_call).upper() for of_class, of_call in found})
    return {"received": table(("message", "fields"), read), "sent": ", ".join(map(code, sent))}


def states() -> dict[str, str]:
    """Diagrams are Mermaid's, which GitHub and the site draw."""
    return {
        "flight_diagram": mermaid_diagram(FLIGHT),
        "flight": transitions(FLIGHT),
        "guard_diagram": mermaid_diagram(GUARD),
        "guard": transitions(GUARD),
    }


def mermaid_diagram(states: Mapping[Any, Mapping[Any, Any]]) -> str:
    """Which state leads to which, each arrow once; a state's words are one name there."""
    names = {state: str(state.value).replace(" ", "_") for state in states}
    arrows = [f"    [*] --> {next(iter(names.values()))}"]
    for state, row in states.items():
        arrows += [f"    {names[state]} --> {names[target]}" for target in row.values() if target is not state]
    arrows += [f"    {names[state]} --> [*]" for state, row in states.items() if not row]
    return "\n".join(["stateDiagram-v2", *dict.fromkeys(arrows)]) + "\n"


def transitions(states: Mapping[Any, Mapping[Any, Any]]) -> str:
    """A row a trigger and what it leads to, with the states in which it does."""
    sources: dict[tuple[str, str], list[str]] = {}
    for state, row in states.items():
        for trigger, target in row.items():
            sources.setdefault((trigger.value, target.value), []).append(state.value)
    rows = [(trigger, ", ".join(inside), target) for (trigger, target), inside in sources.items()]
    return table(("trigger", "in", "leads to"), rows)


# Of each page, whose text stands in `pages/`, the function that makes what is put in.
PAGES: Mapping[str, Callable[[], dict[str, str]]] = {
    "commands.md": commands,
    "mission.md": mission,
    "companion.md": companion,
    "guard.md": guard,
    "world.md": world,
    "airframe.md": airframe,
    "states.md": states,
    "messages.md": messages,
}


def page_text(name: str) -> str:
    """The page as it is to be."""
    text = (Path(__file__).parent / "pages" / name).read_text(encoding="utf-8").format(**PAGES[name]())
    # Below the title, which the site takes from the first line.
    title, rest = text.rstrip().split("\n", 1)
    return f"{title}\n{MADE_BY}{rest}\n"


def run_docs(options: Namespace) -> int:
    """Write those that are not up to date; 0."""
    for name in PAGES:
        path, text = FOLDER / name, page_text(name)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"Written: docs/reference/{name}.")
    return 0
