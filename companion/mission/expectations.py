"""Assertions that a mission makes about its own flight: the item `expect`."""

from typing import Annotated, Self, TypeAlias

from pydantic import ConfigDict, Field, model_validator

from companion.written import NotNegative, PositionNed, Positive, Written, with_bare_keys

Count = Annotated[int, Field(strict=True, ge=0)]


class ExpectHit(Written):
    """From here on, a hit is detected within the time; with a speed before the contact within the bounds given."""

    within_s: Positive
    """From here on."""
    min_speed_m_s: NotNegative | None = None
    """Of the vehicle just before the hit."""
    max_speed_m_s: Positive | None = None
    """Of the vehicle just before the hit."""


class ExpectNoHit(Written):
    """From here on no hit is detected, for the time or until the end of the flight."""

    for_s: Positive | None = None
    """Without it until the end of the flight."""


class ExpectHits(Written):
    """How many hits there have been until here."""

    exactly: Count | None = None
    """So many."""
    at_least: Count | None = None
    """So many or more."""
    at_most: Count | None = None
    """So many or fewer."""

    @model_validator(mode="after")
    def _something(self) -> Self:
        if self.model_dump(exclude_none=True) == {}:
            raise ValueError("give exactly, at_least or at_most")
        return self


class ExpectRecovered(Written):
    """Until here there was a hit, and the latest one has been recovered from."""

    within_s: Positive | None = None
    """At rest again so long after the hit."""
    max_overshoot_m: Positive | None = None
    """So far past the recovery setpoint at most."""


class ExpectPosition(Written):
    """The vehicle is here now."""

    ned_m: PositionNed
    """North, east, down of the arming position."""
    within_m: Positive
    """Distance to it at most."""


class ExpectHeight(Written):
    """The vehicle's height above the arming position now."""

    min_m: NotNegative | None = None
    """At least."""
    max_m: Positive | None = None
    """At most."""

    @model_validator(mode="after")
    def _something(self) -> Self:
        if self.min_m is None and self.max_m is None:
            raise ValueError("give min_m, max_m or both")
        return self


class ExpectSpeed(Written):
    """The vehicle's speed now."""

    max_m_s: Positive
    """At most."""


class ExpectFlightTime(Written):
    """Time since arming, now."""

    at_most_s: Positive
    """Since arming."""


Check: TypeAlias = (
    ExpectHit
    | ExpectNoHit
    | ExpectHits
    | ExpectRecovered
    | ExpectPosition
    | ExpectHeight
    | ExpectSpeed
    | ExpectFlightTime
)


class ExpectItem(Written):
    """A map with exactly one key. One that is not met makes the flight's outcome `failed`; the flight goes on."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    collision: ExpectHit | None = None
    no_collision: ExpectNoHit | None = None
    collisions: ExpectHits | None = None
    recovered: ExpectRecovered | None = None
    position: ExpectPosition | None = None
    height: ExpectHeight | None = None
    speed: ExpectSpeed | None = None
    flight_time: ExpectFlightTime | None = None

    @model_validator(mode="before")
    @classmethod
    def _bare(cls, data: object) -> object:
        return with_bare_keys(data, ("no_collision", "recovered"))

    @model_validator(mode="after")
    def _exactly_one_key(self) -> Self:
        if len(self.model_fields_set) != 1:
            raise ValueError(f"an expectation has exactly one key: {', '.join(ExpectItem.model_fields)}")
        return self

    @property
    def check(self) -> Check:
        check: Check | None = getattr(self, next(iter(self.model_fields_set)))
        assert check is not None, "the validator admits exactly one key"
        return check
