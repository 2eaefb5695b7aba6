"""Assertions that a mission makes about its own flight: the item `expect`."""

from typing import Annotated, Self, TypeAlias

from pydantic import Field, model_validator

from companion.written import NotNegative, PositionNed, Positive, Written, with_bare_keys

Count = Annotated[int, Field(strict=True, ge=0)]


class ExpectHit(Written):
    """From here on, a hit is detected within the time; with a speed before the contact within the bounds given."""

    within_s: Positive
    min_speed_m_s: NotNegative | None = None
    max_speed_m_s: Positive | None = None


class ExpectNoHit(Written):
    """From here on no hit is detected, for the time or until the end of the flight."""

    for_s: Positive | None = None


class ExpectHits(Written):
    """How many hits there have been until here."""

    exactly: Count | None = None
    at_least: Count | None = None
    at_most: Count | None = None

    @model_validator(mode="after")
    def _something(self) -> Self:
        if self.model_dump(exclude_none=True) == {}:
            raise ValueError("give exactly, at_least or at_most")
        return self


class ExpectRecovered(Written):
    """Until here there was a hit, and the latest one has been recovered from."""

    within_s: Positive | None = None
    max_overshoot_m: Positive | None = None


class ExpectPosition(Written):
    """The vehicle is here now."""

    ned_m: PositionNed
    within_m: Positive


class ExpectHeight(Written):
    """The vehicle's height above the arming position now."""

    min_m: NotNegative | None = None
    max_m: Positive | None = None

    @model_validator(mode="after")
    def _something(self) -> Self:
        if self.min_m is None and self.max_m is None:
            raise ValueError("give min_m, max_m or both")
        return self


class ExpectSpeed(Written):
    """The vehicle's speed now."""

    max_m_s: Positive


class ExpectFlightTime(Written):
    """Time since arming, now."""

    at_most_s: Positive


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
