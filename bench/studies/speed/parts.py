"""The parts of an interval: the functions that are measured, each with the one that calls it."""

import importlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

Function = Callable[..., Any]


@dataclass(frozen=True, slots=True)
class Part:
    """What a function does itself, without the other parts that it calls."""

    name: str
    place: str
    """As "module:name" or "module:Class.name"."""
    caller: str | None = None
    """The name of the part that calls it."""


KERNEL, PLANT, VEHICLE, COMPANION, LOG = "plant: kernel", "plant: the rest", "vehicle: autopilot", "companion", "log"
PARTS = (
    Part(KERNEL, "sim_vehicle.plant.plant:advance_interval", PLANT),
    Part(PLANT, "sim_vehicle.plant.plant:Plant._advance", VEHICLE),
    Part(VEHICLE, "sim_vehicle.vehicle:SimulatedVehicle.advance"),
    Part("vehicle: MAVLink in", "sim_vehicle.mavlink.link:Link.receive", VEHICLE),
    Part("vehicle: MAVLink out", "sim_vehicle.mavlink.link:Link.update", VEHICLE),
    Part("companion: MAVLink in", "companion.mavlink.decode:Decoder.feed", COMPANION),
    Part(COMPANION, "companion.companion:Stepped.step"),
    Part("companion: MAVLink out", "companion.mavlink.encode:Encoder.all_packets", COMPANION),
    # The last of an interval of a flight that is logged.
    Part(LOG, "rebound_cli.results.run_folder:FlightRecorder.record"),
)


@contextmanager
def wrapped(wrap: Callable[[Part, Function], Function], parts: Sequence[Part] = PARTS) -> Iterator[None]:
    """Each part's function replaced, for as long as this lasts, by what is made of it."""
    replaced = []
    for part in parts:
        module, _, names = part.place.partition(":")
        owner: Any = importlib.import_module(module)
        *classes, name = names.split(".")
        for class_name in classes:
            owner = getattr(owner, class_name)
        replaced.append((owner, name, vars(owner).get(name)))
        setattr(owner, name, wrap(part, getattr(owner, name)))
    try:
        yield
    finally:
        for owner, name, before in replaced:
            if before is None:
                delattr(owner, name)  # it was inherited
            else:
                setattr(owner, name, before)
