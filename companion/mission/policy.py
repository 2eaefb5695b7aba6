"""What follows a hit, a time-out and an interruption."""

from typing import Annotated, Literal

from pydantic import Field

from companion.strict_model import NotNegative, PositionNed, Positive, StrictModel


class OnCollision(StrictModel):
    """After the recovery. `max_hits` counts the hits of the flight; in an item's own policy, those of the item. What is
    touched again before the vehicle has settled is the same hit."""

    then: Literal["hold", "continue", "retry", "detour", "return", "land"] = "hold"
    """hold: for `hold_s`, then the next item; continue: the next item at once; retry: the same item again, slower;
    detour: the same item again, round what is known by now."""
    hold_s: NotNegative = 3.0
    """How long `hold` holds."""
    retry_speed_factor: Annotated[Positive, Field(le=1.0)] = 0.5
    """Half the speed is a quarter of the energy: the second hit is harmless where the first was bearable."""
    max_hits: Annotated[int, Field(strict=True, ge=1)] = 10
    """At this one `after_max_hits` follows. A mission that meets ten obstacles it does not know of is not being flown
    where it was planned."""
    after_max_hits: Literal["return", "land", "abort"] = "land"
    """abort: hand the vehicle over as `on_interrupt` says."""


class AbortWhen(StrictModel):
    """Conditions that end the mission wherever it is; the vehicle is then handed over as `on_interrupt` says."""

    outside_fence_by_m: Positive | None = 1.0
    """Of the vehicle itself, not its setpoint. A PX4 that flies by GPS moves by half a metre about a setpoint."""
    battery_below_percent: Annotated[Positive, Field(le=100.0)] | None = None
    """As the vehicle tells it; looked at before the start, too."""
    flight_time_above_s: Positive | None = None
    """More than this after arming."""
    setpoint_missed_by_m: Positive | None = None
    """Further from the setpoint than this, the vehicle is not being flown by it."""
    blind_for_s: Positive | None = 10.0
    """A detector without data for this time protects nothing. Links come back within seconds; a stream that was lost or
    a vehicle that shakes too much does not."""
    hit_above_m_s: Positive | None = None
    """After the recovery from a hit this hard: the airframe wants to be looked at."""


class SetpointLimits(StrictModel):
    """What no setpoint exceeds, whatever asks for it; see also the fence."""

    max_speed_m_s: Annotated[Positive, Field(le=20.0)] = 12.0
    """Of a setpoint's velocity, and of how fast it moves on: PX4's own limit."""
    max_step_m: Annotated[Positive, Field(ge=0.5)] = 5.0
    """From the vehicle to a setpoint. PX4 answers one that lies d ahead with 0.95/s * d: 5 m are 4.75
    m/s. Recoveries ask for up to 3 m; a setpoint further off is an estimate that jumped or a mistake."""
    max_tilt_deg: Annotated[Positive, Field(le=60.0)] = 45.0
    """Of an attitude, and of what an acceleration asks for sideways: PX4's own limit."""


class Resume(StrictModel):
    """Where an interrupted flight of this mission is taken up again; `rebound fly --resume RUN` writes it.

    The first flight's arming position is the zero of the coordinates for as long as the vehicle has not been
    restarted, which its boot clock tells.
    """

    at_step: Annotated[int, Field(strict=True, ge=1)]
    """With the repeats written out, counted from 0."""
    origin_ned_m: PositionNed
    """Of the first flight, in the vehicle's local frame."""
    armed_at_us: Annotated[int, Field(strict=True, ge=0)]
    """By the companion's clock."""
    armed_boot_us: Annotated[int, Field(strict=True, ge=0)]
    """By the vehicle's clock."""
    hits: Annotated[int, Field(strict=True, ge=0)] = 0
    """Number of earlier hits; the mission's expectations count them."""
