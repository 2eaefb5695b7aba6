"""From which height on a shake is a hit: one answer for the flight and for the guard."""

from companion.flight.context import FlightContext
from companion.messages import LandedState

# A vehicle that has come down lower than this, and was not told to, drags itself along the ground: nothing of that is a
# hit to recover from. Its feet are a tenth of a metre below it, and where it leans they are not what touches.
SCRAPING_M = 0.1


def note_height(flight: FlightContext) -> None:
    """Whether the vehicle has left the ground behind; a hit that throws it down again does not bring that back."""
    height_m = flight.height_m
    if height_m is not None and height_m >= flight.mission.companion.min_detection_height_m:
        flight.has_climbed = True
    elif height_m is None or flight.vehicle.landed is LandedState.ON_GROUND:
        flight.has_climbed = False


def landed(flight: FlightContext, goes_down: bool) -> LandedState:
    """What the vehicle says of the ground. Up by its own height, and not on its way down, it has not landed.

    Who says so may have forged it, and a detector is off on the ground.
    """
    is_up = flight.has_climbed and not goes_down and flight.vehicle.landed is LandedState.ON_GROUND
    return LandedState.UNDEFINED if is_up else flight.vehicle.landed


def too_low(flight: FlightContext, goes_down: bool) -> str | None:
    """Why the height stands against a hit, or None. `goes_down`: the vehicle is to meet the ground."""
    least_m, height_m = flight.mission.companion.min_detection_height_m, flight.height_m
    if flight.has_climbed and not goes_down:
        least_m = min(least_m, SCRAPING_M)
    return f"below {least_m:g} m" if height_m is None or height_m < least_m else None
