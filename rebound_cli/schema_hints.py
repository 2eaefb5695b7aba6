"""Which keys a pydantic model allows at a path, for errors that name the remedy."""

import difflib
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

from pydantic import BaseModel


def nearest(word: str, choices: Sequence[str]) -> str | None:
    """The choice that a person most likely meant, if any is close."""
    found = difflib.get_close_matches(word, choices, n=1, cutoff=0.6)
    return found[0] if found else None


@cache
def _schema(model: type[BaseModel]) -> dict[str, Any]:
    """Made once: it takes some 0.1 s, and a file can have thousands of faults."""
    return model.model_json_schema()


def keys_allowed_at(model: type[BaseModel], path: Sequence[str | int]) -> tuple[str, ...]:
    """Keys of every model that may stand at `path`, in the order of the model."""
    schema = _schema(model)
    definitions = schema.get("$defs", {})
    places = list(_resolved(schema, definitions))
    for part in path:
        places = [below for place in places for below in _below(place, part, definitions)]
    keys: dict[str, None] = {}
    for place in places:
        keys.update(dict.fromkeys(place.get("properties", {})))
    return tuple(keys)


def _resolved(schema: Any, definitions: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The schema itself, its reference followed and its alternatives spread out."""
    if not isinstance(schema, dict):
        return
    if "$ref" in schema:
        yield from _resolved(definitions[schema["$ref"].rpartition("/")[2]], definitions)
        return
    alternatives = [*schema.get("anyOf", ()), *schema.get("oneOf", ()), *schema.get("allOf", ())]
    if not alternatives or "properties" in schema:
        yield schema
    for alternative in alternatives:
        yield from _resolved(alternative, definitions)


def _below(schema: dict[str, Any], part: str | int, definitions: dict[str, Any]) -> Iterator[dict[str, Any]]:
    if isinstance(part, str):
        child = schema.get("properties", {}).get(part, schema.get("additionalProperties"))
    else:
        prefixed = schema.get("prefixItems", ())
        child = prefixed[part] if part < len(prefixed) else schema.get("items")
    yield from _resolved(child, definitions)
