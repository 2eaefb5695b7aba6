"""The round trip to the vehicle and back, by TIMESYNC. Times are on the companion's clock.

A hit is answered a round trip late: the sample that shows it comes late, and so does the setpoint that answers it.
"""

from collections import Counter, deque
from dataclasses import dataclass, field
from statistics import median_low

from companion.messages import TimeSync

# Until a first answer as often as PX4 asks by itself (its TIMESYNC stream has 10 Hz): a lost packet delays nothing, and
# a slow link is judged by several answers at once. Then as often as a HEARTBEAT.
FIRST_INTERVAL_US, INTERVAL_US = 100_000, 1_000_000
# The median of five stands when two of them were held up by a busy computer, and follows a change within three seconds.
RECENT = 5
# A vehicle at 2 m/s goes 0.2 m in it: as old as a position may be (StreamsConfig.min_local_position_hz).
MOST_US = 100_000
# Questions that are remembered: more than six seconds of them, which is longer than any link that flies a vehicle.
_MOST_ON_THE_WAY = 64
# Of the flight's median. PX4 answers within 0.14 to 0.5 ms; finer digits are noise.
_RESOLUTION_US = 100


@dataclass(slots=True)
class RoundTrip:
    """Sends TIMESYNC, matches the answers, and measures. An answer without a request is only counted."""

    worst_us: int | None = None
    ignored: int = 0
    due_us: int = 0  # of the next request
    _recent_us: deque[int] = field(default_factory=lambda: deque(maxlen=RECENT))
    _all_us: Counter[int] = field(default_factory=Counter)
    _asked_ns: deque[int] = field(default_factory=lambda: deque(maxlen=_MOST_ON_THE_WAY))  # not yet answered
    _is_told: bool = False

    def ask(self, now_us: int) -> TimeSync:
        self.due_us = now_us + (INTERVAL_US if self._recent_us else FIRST_INTERVAL_US)
        self._asked_ns.append(now_us * 1000)
        return TimeSync(now_us * 1000)

    def update(self, answer: TimeSync, now_us: int) -> None:
        """Take an answer; only the first to each request counts."""
        asked_ns = answer.asked_ns
        if asked_ns not in self._asked_ns:
            self.ignored += 1
            return
        self._asked_ns.remove(asked_ns)
        trip_us = now_us - asked_ns // 1000
        self._recent_us.append(trip_us)
        self._all_us[round(trip_us / _RESOLUTION_US) * _RESOLUTION_US] += 1
        self.worst_us = trip_us if self.worst_us is None else max(self.worst_us, trip_us)

    @property
    def present_us(self) -> int | None:
        """Median of the last few; None before an answer."""
        return median_low(self._recent_us) if self._recent_us else None

    @property
    def median_us(self) -> int | None:
        """Of all answers."""
        return median_low(self._all_us.elements()) if self._all_us else None

    def summary_ms(self) -> dict[str, float | None]:
        """None without an answer. `ignored` counts answers to no question of ours."""
        median_ms, worst_ms = (None if us is None else us / 1e3 for us in (self.median_us, self.worst_us))
        return {"median": median_ms, "worst": worst_ms, "ignored": self.ignored}

    def complaint(self) -> str | None:
        """One sentence when the round trip is too long to begin; None before the first answer."""
        present_us = self.present_us
        if present_us is None or present_us <= MOST_US:
            return None
        return (
            f"the round trip to the vehicle takes {present_us / 1e3:.0f} ms and at most {MOST_US / 1e3:.0f} ms are "
            "allowed; use a wire or a direct link"
        )

    def alarm(self) -> str | None:
        """The report of a round trip that has become too long, once until the last few are all short."""
        present_us, was_told = self.present_us or 0, self._is_told
        is_long = present_us > MOST_US
        self._is_told = is_long or (was_told and any(trip_us > MOST_US for trip_us in self._recent_us))
        return f"round trip {present_us / 1e3:.0f} ms: hits are answered late" if is_long and not was_told else None
