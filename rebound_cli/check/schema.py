"""The JSON schema of mission files: the mission's own with the simulated world's `sim:` part put in."""

from typing import Any

from companion.mission.model import Mission
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
    return {"$schema": DRAFT, **schema, "title": "Mission file of px4-rebound"}
