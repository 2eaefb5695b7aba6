"""Flights on the simulated vehicle: a mission that ships, or one that a test writes."""

from pathlib import Path
from typing import Any

import numpy as np

from companion.companion import Companion
from rebound_cli.inputs.documents import Document, apply_overrides, load_document
from rebound_cli.inputs.inputs import mission_from, world_from
from sim_vehicle.truth import Hit
from sim_vehicle.vehicle import SimulatedVehicle
from tests.flying import Flight

MISSIONS = Path(__file__).parents[1] / "missions"


class SimulatedFlight(Flight):
    """With what really happened."""

    @property
    def hits(self) -> list[Hit]:
        return list(self.vehicle.truth.hits)

    @property
    def series(self) -> dict[str, Any]:
        """Time, place, velocity and attitude, a row each interval."""
        return dict(self.vehicle.truth.series())

    @property
    def tilt_deg(self) -> Any:
        """How far the vehicle leant, in each row."""
        _, x, y, _ = self.series["attitude_wxyz"].T
        return np.degrees(np.arccos(1.0 - 2.0 * (x * x + y * y)))


def simulated(mission: str | list[Any], *sets: str, **keys: Any) -> SimulatedFlight:
    """On the ground and confirmed: a mission of `missions/` by name, or one of these items.

    `sets` change it as `--set` does; `keys` replace whole parts of it, such as `sim` or `fence`.
    """
    if isinstance(mission, str):
        document = load_document(MISSIONS / f"{mission}.yaml")
    else:
        document = Document("test.yaml", {"name": "test", "items": mission})
    document.data |= keys
    apply_overrides(document, sets)
    world = world_from(document)
    companion = Companion(mission_from(document, world))
    companion.confirm_plan()
    return SimulatedFlight(companion, SimulatedVehicle(world.airframe, world.scene, world.scene.seed))


def flown(*items: Any, height_m: float = 1.5, **keys: Any) -> SimulatedFlight:
    """Up, through the items, and down; over."""
    flight = simulated([{"takeoff": {"height_m": height_m}}, *items, {"land": {}}], **keys)
    flight.run_to_end(300.0)
    return flight


def wall(north_m: float, **more: Any) -> dict[str, Any]:
    """Across the way north, as wide and high as anything flown here."""
    return {"point_ned_m": [north_m, 0, -2], "normal_ned": [-1, 0, 0], "width_m": 8, "height_m": 8, **more}
