"""The schema of mission files, for editors."""

import ast
import functools
import inspect
import sys
from itertools import pairwise
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core.core_schema import ModelSchema

from companion.mission.config import CompanionConfig
from companion.mission.model import Mission
from sim_vehicle.scene import Scene

DRAFT = "https://json-schema.org/draft/2020-12/schema"


class DescribedSchema(GenerateJsonSchema):
    """Each key with its docstring."""

    def model_schema(self, schema: ModelSchema) -> JsonSchemaValue:
        written = super().model_schema(schema)
        for base in schema["cls"].__mro__:
            declared = _docstrings_in(base.__module__).get(base.__name__, {}) if issubclass(base, BaseModel) else {}
            for name, text in declared.items():
                written["properties"].get(name, {}).setdefault("description", text)
        return written


@functools.cache
def _docstrings_in(module: str) -> dict[str, dict[str, str]]:
    """Of each class, of each key that it declares; from the source, as Python keeps no docstring of an attribute."""
    source = ast.parse(inspect.getsource(sys.modules[module]))
    return {
        declared.name: {
            key.target.id: inspect.cleandoc(str(following.value.value))
            for key, following in pairwise(declared.body)
            if isinstance(key, ast.AnnAssign) and isinstance(key.target, ast.Name)
            if isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant)
        }
        for declared in source.body
        if isinstance(declared, ast.ClassDef)
    }


def mission_schema() -> dict[str, Any]:
    """For editors; what only a look at several values together shows is left to `rebound check MISSION`."""
    schema = Mission.model_json_schema(by_alias=True, schema_generator=DescribedSchema)
    scene = Scene.model_json_schema(ref_template="#/$defs/{model}", schema_generator=DescribedSchema)
    definitions = schema["$defs"]
    for name, definition in scene.pop("$defs", {}).items():
        assert definitions.setdefault(name, definition) == definition, f"two parts of the schema are called {name}"
    definitions["Scene"] = scene
    schema["properties"]["sim"] = {"anyOf": [{"$ref": "#/$defs/Scene"}, {"type": "null"}], "default": None}
    schema["properties"]["items"]["prefixItems"] = [{"$ref": "#/$defs/MissionItem", "required": ["takeoff"]}]
    definitions["CompanionConfig"]["properties"]["detector"]["enum"] = sorted(CompanionConfig.detectors)
    for part in (schema, *definitions.values()):
        for written in part.get("properties", {}).values():
            _describe_by_part(written, part, definitions)
    return {"$schema": DRAFT, **schema, "title": "Mission file of px4-rebound"}


def _describe_by_part(written: dict[str, Any], part: dict[str, Any], definitions: dict[str, Any]) -> None:
    """A key that is nothing but a part of its own, or names its kind, is described by what is said of that part."""
    parts = [choice["$ref"] for choice in written.get("anyOf", [written]) if "$ref" in choice]
    described = part if "const" in written else definitions[parts[0].rpartition("/")[2]] if len(parts) == 1 else {}
    if "description" in described:
        written.setdefault("description", described["description"])
