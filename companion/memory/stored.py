"""Obstacle memory as people and files have it: the mission's `obstacles:` part and `obstacles.json`."""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from companion.memory.patch import Patch
from companion.strict_model import Positive, StrictModel

# To a tenth of a millimetre, and without the exponents that YAML takes for text.
_DIGITS = 4


class ObstacleFile(StrictModel):
    """The whole of an `obstacles.json`."""

    patches: tuple[Patch, ...]
    """One for each surface."""


class ObstaclesConfig(StrictModel):
    """The mission's `obstacles:` part: what is known beforehand, and what follows where that leaves no way."""

    file: Annotated[str, Field(min_length=1)] | None = None
    """A file of them, such as the obstacles.json of an earlier run; beside the mission file, or an absolute path."""
    known: tuple[Patch, ...] = ()
    """The same, written out here."""
    margin_m: Positive = 0.35
    """Between the guards and what is known. As recovery.clearance_m: guards 0.3 m clear, and 5 cm for the drift of
    a hover on optical flow."""
    on_unreachable: Literal["land", "return", "continue", "abort"] = "land"
    """continue: with the next item; abort: hand the vehicle over as `on_interrupt` says."""

    @model_validator(mode="after")
    def _is_read(self) -> Self:
        if self.file is not None:
            raise ValueError(f"file: {self.file} was not read; load the mission with rebound, or give `known`")
        return self


def as_data(patch: Patch) -> dict[str, Any]:
    """A patch as files have it; `Patch` reads it back."""
    return {key: _rounded(value) for key, value in patch}


def _rounded(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_rounded(part) for part in value]
    # Adding 0.0 turns a rounded -0.0 into 0.0.
    return round(value, _DIGITS) + 0.0 if isinstance(value, float) else value


def describe(patch: Patch) -> str:
    """For people: what, where, how much of it."""
    n, e, d = patch.centre_ned_m
    count = len(patch.touches_ned_m)
    hits = "touched once" if count == 1 else f"touched {count} times"
    place = f"[{n:z.2f}, {e:z.2f}, {d:z.2f}]"
    north, east, down = patch.normal_ned
    if patch.is_steep:
        return f"surface {'above' if down > 0.0 else 'below'} at {place}, {hits}"
    facing_deg = round(math.degrees(math.atan2(east, north))) % 360
    low_m, high_m = patch.assumed_along_m()
    return f"surface facing {facing_deg} deg at {place}, {hits}, assumed {high_m - low_m:.1f} m wide"
