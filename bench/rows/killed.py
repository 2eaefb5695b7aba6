"""What became of a flight in which somebody is killed around a hit, by the truth."""

import math
from collections.abc import Callable, Sequence

from bench.cases.vehicles import AIRFRAMES
from bench.fly.campaign import Json
from bench.fly.copies import Copies
from bench.fly.lockstep import STANDS_M
from sim_vehicle.airframe import load_built_in
from sim_vehicle.truth import Hit
from sim_vehicle.vehicle import SimulatedVehicle

# Both airframes stand as high.
DOWN_M = -load_built_in(AIRFRAMES[0]).geometry.foot_depth_m - STANDS_M


def killed_copies(kills_s: Sequence[float], fly_until: Callable[[float], None], die: Callable[[], Json]) -> list[Json]:
    """Of each instant what became of a copy of the flight in which somebody dies then."""
    copies = Copies()
    for kill_s in kills_s:
        fly_until(kill_s)
        if copies.fork(str(kill_s)):
            copies.leave(die)
    return [*copies.found.values()]


def is_down(vehicle: SimulatedVehicle) -> bool:
    return float(vehicle.state.body[2]) > DOWN_M


def became(vehicle: SimulatedVehicle, since_s: float, killed_us: int) -> Json:
    """Since when somebody was dead, how hard the wall was met again (0: not), and how fast the ground."""
    later = [hit for hit in vehicle.truth.hits if hit.contact_at_boot_us >= killed_us]
    # The touch itself is no second one, whenever it came.
    again_m_s = hardest(later[1:] if since_s < 0.0 else later)
    ground_m_s = math.hypot(*vehicle.truth.series()["velocity_ned_m_s"][-1]) if is_down(vehicle) else None
    return {"kill_s": since_s, "again_m_s": again_m_s, "ground_m_s": ground_m_s}


def hardest(hits: Sequence[Hit]) -> float:
    """0 where there is none."""
    return max((hit.closing_speed_m_s for hit in hits), default=0.0)
