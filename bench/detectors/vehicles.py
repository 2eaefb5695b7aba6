"""The vehicles of the bench: a named airframe, or one drawn from the case's seed, each with its owner's settings."""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from bench.random_missions.vehicle import companion_settings, drawn_vehicle
from rebound_cli.inputs import guards_of
from sim_vehicle.airframe import Airframe, load_built_in, with_base

AIRFRAMES = ("foldable", "rigid")


@dataclass(frozen=True, slots=True)
class BenchVehicle:
    """An airframe, and what its owner writes into `companion:` of a mission with it."""

    airframe: Airframe
    settings: dict[str, Any] = field(default_factory=dict)


@lru_cache(maxsize=16)
def vehicle_of(kind: str, seed: int | None = None) -> BenchVehicle:
    """The named airframe, or of a seed the vehicle of its kind that is drawn from it.

    Reading an airframe's file takes longer than flying a hit with it.
    """
    if seed is None:
        airframe = load_built_in(kind)
        return BenchVehicle(airframe, {"estimate": {"guards": guards_of(airframe)}})
    data = drawn_vehicle(seed, kind)
    return BenchVehicle(Airframe.model_validate(with_base(data)), companion_settings(data))
