"""The JSON schema of mission files: the mission's own with the simulated world's `sim:` part put in."""

from typing import Any

from companion.detection.registry import DETECTORS
from companion.mission.model import Mission
from companion.reflex.laws import RECOVERY_LAWS
from sim_vehicle.scene import Scene

DRAFT = "https://json-schema.org/draft/2020-12/schema"


def mission_schema() -> dict[str, Any]:
    """For editors; what only a look at several values together shows is left to `rebound check MISSION`."""
    schema = Mission.model_json_schema(by_alias=True)
    scene = Scene.model_json_schema(ref_template="#/$defs/{model}")
    definitions = schema["$defs"]
    for name, definition in scene.pop("$defs", {}).items():
        assert definitions.setdefault(name, definition) == definition, f"two parts of the schema are called {name}"
    definitions["Scene"] = scene
    schema["properties"]["sim"] = {"anyOf": [{"$ref": "#/$defs/Scene"}, {"type": "null"}], "default": None}
    schema["properties"]["items"]["prefixItems"] = [{"$ref": "#/$defs/MissionItem", "required": ["takeoff"]}]
    definitions["RecoveryConfig"]["properties"]["law"]["enum"] = sorted(RECOVERY_LAWS)
    definitions["CompanionConfig"]["properties"]["detector"]["enum"] = sorted(DETECTORS)
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
