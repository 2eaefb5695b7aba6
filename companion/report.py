"""What a flight tells: events as they happen, a live status, and the report at the end."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from companion.memory.patch import Patch
from companion.messages import Vector3
from companion.reflex.detection.health import Promise
from companion.reflex.recovery.collision import CollisionReport

JsonValue: TypeAlias = "bool | int | float | str | Sequence[JsonValue] | Mapping[str, JsonValue] | None"

Outcome: TypeAlias = Literal["completed", "aborted", "failed"]


@dataclass(frozen=True, slots=True)
class Event:
    """Something worth a line in the timeline; `text` is for people, `data` for tools."""

    time_us: int
    kind: str
    text: str
    data: Mapping[str, JsonValue]


@dataclass(frozen=True, slots=True)
class Status:
    """The live line. Position is the vehicle's local NED estimate, the round trip TIMESYNC's; None before an answer."""

    state: str
    vehicle_mode: str
    armed: bool
    position_ned_m: Vector3 | None
    speed_m_s: float | None
    detector: str
    round_trip_us: int | None


@dataclass(frozen=True, slots=True)
class ExpectationReport:
    """An assertion of the mission's: `label` is its item's number, `detail` what was found."""

    label: str
    text: str
    met: bool | None = None  # None: the flight is not over
    detail: str = ""


@dataclass(frozen=True, slots=True)
class FlightReport:
    """The outcome of a flight.

    `failed`: the flight never began (no vehicle, wrong vehicle, streams too slow, refused), or it ended as it should
    but not as the mission expected (`expectations`). `aborted`: it began, or was stopped by the person, and ended
    before the mission did.
    """

    outcome: Outcome
    reason: str
    autopilot: str
    stream_rates_hz: Mapping[str, float]
    collisions: tuple[CollisionReport, ...]
    origin_ned_m: Vector3 | None  # the arming position in the vehicle's local NED: the zero of mission coordinates
    started_at_us: int
    ended_at_us: int
    armed_at_us: int | None
    expectations: tuple[ExpectationReport, ...] = ()
    obstacles: tuple[Patch, ...] = ()  # known at the end, from before and from this flight's hits; mission coordinates
    unreachable: tuple[str, ...] = ()  # labels of items, or "home", to which that left no way
    refused_messages: Mapping[str, int] = field(default_factory=dict)  # the vehicle's that were not accepted, by name
    unconfirmed: int = 0  # hits that were none: one sample showed them, and nothing else
    round_trip_ms: Mapping[str, float | None] = field(default_factory=dict)  # as summary.json has it
    promise: Promise | None = None  # the detector's, when it was last armed
    crashed: str = ""  # how; empty of a vehicle that has not
