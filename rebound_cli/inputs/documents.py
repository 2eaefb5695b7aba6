"""YAML files with the line of every value, `--set PATH=VALUE`, and errors that name file, line and remedy."""

import difflib
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from operator import eq
from pathlib import Path
from typing import Any, TypeVar, get_args

import yaml
from pydantic import BaseModel, ValidationError

from companion.errors import ConfigurationError

DocumentPath = tuple[str | int, ...]
Model = TypeVar("Model", bound=BaseModel)

# The missions that ship have a thousand characters; PyYAML takes ten seconds for a million.
MOST_CHARACTERS = 1_000_000

# A reader repairs the first few faults and runs again; a longer list only hides them.
_MOST_ERRORS_SHOWN = 5

_ITEM_NUMBER = re.compile(r"\bitem (\d+)\b")
_WITH_COMMA = re.compile(r"[-+]?\d+,\d+")
# pydantic speaks of the program's types, the person wrote YAML.
_OF_THE_MODEL = re.compile(r"a valid (tuple|list|dictionary( or instance of \w+)?)")


class _Loader(yaml.SafeLoader):
    """Takes 1e-3 for a number, as editors and YAML 1.2 do; YAML 1.1 wants 1.0e-3."""


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"), list("-+.0123456789")
)


class DocumentError(ConfigurationError):
    """A file, or a value given with --set, that cannot be used."""


@dataclass(slots=True)
class Document:
    """The content of a YAML file: plain data, where each value stands, and what the command line has put in its place.

    `overrides`: where, and as the person typed it, such as `--set items.1.go_to.speed_m_s=2.5`.
    """

    name: str
    data: dict[str, Any] = field(default_factory=dict)
    lines: dict[DocumentPath, int] = field(default_factory=dict)
    overrides: list[tuple[DocumentPath, str]] = field(default_factory=list)

    def override_of(self, path: DocumentPath) -> str | None:
        """The last --set that gave this value, or a part around or inside it."""
        return next((text for given, text in reversed(self.overrides) if path and all(map(eq, path, given))), None)

    def place_of(self, path: DocumentPath) -> str:
        """Where a person has to look: `--set items.1=...` or `missions/wall.yaml:12`.

        That is the line of the value, or of the nearest part around it that the file has; 1 for the whole file.
        """
        if (override := self.override_of(path)) is not None:
            return override
        if not self.lines:
            return self.name
        around = (self.lines[path[:length]] for length in range(len(path), 0, -1) if path[:length] in self.lines)
        return f"{self.name}:{next(around, 1)}"

    def put(self, text: str, path: DocumentPath, value: Any) -> None:
        """Change one value, as `text` asks for; keys that are missing on the way are made, and the model judges them
        afterwards.
        """
        target: Any = self.data
        for depth, part in enumerate(path):
            where = ".".join(map(str, path[:depth]))
            if isinstance(target, dict):
                part = str(part)
            elif not isinstance(target, list):
                raise DocumentError(f"{text}: '{where}' is a single value and has nothing below it.")
            elif not isinstance(part, int) or part >= len(target):
                why = f"'{where}' is a list of {len(target)}, counted from 0; it has no '{part}'"
                raise DocumentError(f"{text}: {why}.")
            if depth == len(path) - 1:
                target[part] = value
            elif isinstance(target, dict) and target.get(part) is None:
                target[part] = {}
            target = target[part]
        self.overrides.append((path, text))

    def put_option(self, option: str, path: DocumentPath, value: Any, given: object = None) -> None:
        """The value of a command line's option; `given`: as the person typed it, where that differs."""
        self.put(f"{option} {value if given is None else given}", path, value)


def load_document(path: Path, shipped_names: Iterable[str] = ()) -> Document:
    """Read one YAML file whose top level is a mapping; `shipped_names` could have been meant. Raises DocumentError."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        # A name alone may be meant for one that ships.
        places = {entry.name: path.with_name(entry.name) for entry in path.parent.glob("*.yaml")}
        places |= {name: Path(name) for name in shipped_names if path.name == str(path)}
        match = nearest(path.name, tuple(places))
        meant = f"; did you mean {places[match]}?" if match else "."
        raise DocumentError(f"{path}: no such file{meant}") from None
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "it is not UTF-8 text"
        raise DocumentError(f"{path}: cannot be read: {reason}.") from error
    return parse_document(text, str(path))


def parse_document(text: str, name: str) -> Document:
    """Read YAML text; `name` is what errors call it. Raises DocumentError."""
    if len(text) > MOST_CHARACTERS:
        raise DocumentError(f"{name}: longer than {MOST_CHARACTERS // 1_000_000} MB; no file that a person writes is.")
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            raise DocumentError(f"{name}: the file is empty.")
        if not isinstance(node, yaml.MappingNode):
            raise DocumentError(f"{name}:{_line(node)}: a mapping was expected here, such as 'name: square'.")
        lines = {}
        for path, line in _lines_below(node, (), name):
            lines[path] = line
            # Every value that is written out takes a character; only aliases of aliases make more of them.
            if len(lines) > len(text):
                raise DocumentError(f"{name}:{line}: aliases in aliases or in themselves; write the values out.")
        data = loader.construct_document(node)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 1
        raise DocumentError(f"{name}:{line}: not valid YAML: {error.problem or error.context}.") from error
    except yaml.YAMLError as error:
        raise DocumentError(f"{name}: not valid YAML: {' '.join(str(error).split())}.") from error
    except ValueError as error:
        # PyYAML makes a date or a number of what looks like one: the 99th of some month, 5000 digits.
        raise DocumentError(f"{name}: a value in it cannot be read: {str(error).partition(';')[0]}.") from error
    except RecursionError as error:
        raise DocumentError(f"{name}: nested too deeply, or in itself.") from error
    return Document(name, data, lines)


def refuse_existing(out: Path | None) -> None:
    """Before long work whose file would take another's place. Raises DocumentError."""
    if out is not None and out.exists():
        raise DocumentError(f"{out} exists already: give --out another name.")


def refuse_special(out: Path) -> None:
    """A file that is written whole takes the place of what is there, be it a device. Raises DocumentError."""
    if out.is_symlink() or (out.exists() and not out.is_file()):
        raise DocumentError(f"{out} is no ordinary file: give --out another name.")
    if not os.access(out.parent, os.W_OK | os.X_OK):
        raise DocumentError(f"{out}: {out.parent} is no folder that can be written to; give --out another.")


def _line(node: yaml.Node) -> int:
    return int(node.start_mark.line) + 1


def _lines_below(node: yaml.Node, path: DocumentPath, name: str) -> Iterator[tuple[DocumentPath, int]]:
    if isinstance(node, yaml.MappingNode):
        seen: dict[str, int] = {}
        for key_node, value_node in node.value:
            key = str(key_node.value)
            if key in seen:
                first = f"first on line {seen[key]}"
                raise DocumentError(f"{name}:{_line(key_node)}: '{key}' is given twice ({first}); remove one.")
            seen[key] = _line(key_node)
            yield (*path, key), _line(key_node)
            yield from _lines_below(value_node, (*path, key), name)
    elif isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            yield (*path, index), _line(item)
            yield from _lines_below(item, (*path, index), name)


def parse_override(text: str) -> tuple[DocumentPath, Any]:
    """Read `items.1.go_to.speed_m_s=2.5`; the value is YAML. Raises DocumentError."""
    dotted, separator, value_text = text.partition("=")
    parts = dotted.strip().split(".")
    if not separator or not all(parts):
        raise DocumentError(f"--set {text}: give PATH=VALUE, such as items.1.go_to.speed_m_s=2.5.")
    try:
        value = yaml.load(value_text, _Loader)
    except (yaml.YAMLError, ValueError, RecursionError):
        raise DocumentError(f"--set {text}: the value {value_text!r} is not valid YAML.") from None
    return tuple(int(part) if part.isdecimal() else part for part in parts), value


def apply_overrides(document: Document, texts: Sequence[str], part: str | None = None) -> None:
    """Apply every `--set` in order; where only one `part` counts, to that. Raises DocumentError."""
    for text in texts:
        path, value = parse_override(text)
        if part not in (None, path[0]):
            raise DocumentError(f"--set {text}: only what begins with {part}. counts here.")
        document.put(f"--set {text}", path, value)


def validated(model: type[Model], document: Document, data: Any, prefix: DocumentPath = ()) -> Model:
    """`data`, the document below `prefix`, as a model. Raises DocumentError with the place of every fault."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        # pydantic counts the sound items of a list: one that is wrong makes it no shorter.
        found = [
            fault
            for fault in error.errors()
            if fault["type"] != "too_short" or len(fault["input"]) < fault["ctx"]["min_length"]
        ]
        faults = list(dict.fromkeys(_fault_text(model, document, data, prefix, fault) for fault in found))
        shown = faults[:_MOST_ERRORS_SHOWN]
        if len(faults) > len(shown):
            shown.append(f"... and {len(faults) - len(shown)} more.")
        raise DocumentError("\n".join(shown)) from error


def _fault_text(model: type[BaseModel], document: Document, data: Any, prefix: DocumentPath, error: Any) -> str:
    path = _path_in_data(data, error["loc"], missing=error["type"] == "missing")
    full = (*prefix, *path)
    label = ".".join(map(str, full))
    place = document.place_of(full or _path_in_message(str(error["msg"])))
    sentence = _sentence(model, path, error)
    return f"{place}: {label}: {sentence}." if label else f"{place}: {sentence}."


def _path_in_data(data: Any, location: Sequence[str | int], missing: bool) -> DocumentPath:
    """The error's location without the names of union members that pydantic adds to it."""
    path: list[str | int] = []
    for depth, part in enumerate(location):
        is_key = isinstance(data, dict) and part in data
        is_index = isinstance(data, list) and isinstance(part, int) and part < len(data)
        if is_key or is_index:
            path.append(part)
            data = data[part]
        elif missing and depth == len(location) - 1:
            path.append(part)
    return tuple(path)


def _path_in_message(message: str) -> DocumentPath:
    """Rules about the whole mission name the part they mean: "items: item 3 is land, ..."."""
    if not message.removeprefix("Value error, ").startswith("items:"):
        return ()
    item = _ITEM_NUMBER.search(message)
    return ("items", int(item[1]) - 1) if item else ("items",)


def _sentence(model: type[BaseModel], path: DocumentPath, error: Any) -> str:
    kind = error["type"]
    if kind == "extra_forbidden":
        allowed = keys_allowed_at(model, path[:-1])
        return _unknown("key", str(path[-1]) if path else "?", allowed)
    if kind == "missing":
        return "is missing; add it"
    if kind in ("too_short", "too_long"):
        least, most = (error["ctx"].get(name) for name in ("min_length", "max_length"))
        bound = f"at least {least}" if kind == "too_short" else f"at most {most}"
        return f"needs {bound} of them, and has {error['ctx']['actual_length']}"
    if kind == "union_tag_invalid":
        tags = [each.strip("' ") for each in error["ctx"]["expected_tags"].split(",")]
        return _unknown("kind", error["ctx"]["tag"], tags)
    message = str(error["msg"]).removeprefix("Value error, ")
    message = message.replace("Input should be", "must be").rstrip(".")
    message = _OF_THE_MODEL.sub(lambda found: "a list" if "tuple" in found[0] else "a mapping", message)
    given = error.get("input")
    if kind == "invalid_key":
        return f"'{given}' is no key; a number is written with a point, such as 1.5"
    if kind != "value_error" and isinstance(given, str | int | float | None):
        message += f", not {given!r}" if given is not None else ", not empty"
        if isinstance(given, str) and _WITH_COMMA.fullmatch(given):
            message += f"; write {given.replace(',', '.')}"
    return message[:1].lower() + message[1:]


def _unknown(what: str, word: str, allowed: Sequence[str]) -> str:
    if not allowed:
        return f"unknown {what} '{word}'; no {what}s are allowed here"
    match = nearest(word, allowed)
    question = f"did you mean '{match}'? Allowed" if match else "allowed"
    return f"unknown {what} '{word}'; {question} here: {', '.join(allowed)}"


def nearest(word: str, choices: Sequence[str]) -> str | None:
    """The choice that a person most likely meant, if any is close."""
    found = difflib.get_close_matches(word, choices, n=1, cutoff=0.6)
    return found[0] if found else None


def suggestion(word: str, choices: Iterable[str]) -> str:
    """The end of a sentence about a word that is none of these."""
    match = nearest(word, tuple(choices))
    return f"; did you mean {match}?" if match else "."


def keys_allowed_at(model: type[BaseModel], path: Sequence[str | int]) -> tuple[str, ...]:
    """Keys of every model that may stand at `path`, in the order of the model."""
    models = [model]
    for part in path:
        # Whatever the place in a list, the models are the same.
        if isinstance(part, str):
            fields = [field for above in models for name, field in _written_keys(above) if name == part]
            models = [below for field in fields for below in _models_in(field.annotation)]
    return tuple(dict.fromkeys(name for below in models for name, _ in _written_keys(below)))


def _written_keys(model: type[BaseModel]) -> Iterator[tuple[str, Any]]:
    yield from ((field.alias or name, field) for name, field in model.model_fields.items())


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models_in(part)
