"""The guard as a step function: bytes and the time in, bytes and events out."""

from typing import ClassVar

from companion.companion import Stepped
from companion.guard.config import GuardConfig
from companion.guard.core import GuardCore
from companion.guard.states import State
from companion.mavlink.readers import LONE_GUARD_READERS
from companion.report import CollisionReport, RoundTripReport


class Guard(Stepped[GuardCore]):
    """On a link of its own: what others send to the vehicle does not pass through here."""

    _first_state: ClassVar = State.CONNECTING.value

    def __init__(self, config: GuardConfig) -> None:
        super().__init__(LONE_GUARD_READERS)
        self._config = config

    def _begun(self, now_us: int) -> GuardCore:
        return GuardCore(self._config, False, now_us)

    @property
    def outcome(self) -> str:
        """Why it ended."""
        return "" if self._core is None else self._core.machine.outcome

    def collisions(self) -> tuple[CollisionReport, ...]:
        return () if self._core is None else self._core.collisions()

    def left_alone(self) -> int:
        """Hits that were told and left to the program that flies."""
        return 0 if self._core is None else self._core.flight.left_alone

    def round_trip(self) -> RoundTripReport:
        return RoundTripReport() if self._core is None else self._core.flight.round_trip.report()
