"""Refused messages of the vehicle: counted, and reported when they go on."""

from collections import Counter
from dataclasses import dataclass, field

from companion.autopilot.known import defaults

# One broken packet is a matter for the count. For as long the last setpoint is flown on.
LASTING_US = defaults.LOSS_US


@dataclass(slots=True)
class Refusals:
    """How often each message was refused, and the present run of each: refusals with less than LASTING_US between."""

    counts: Counter[str] = field(default_factory=Counter)
    _runs: dict[str, tuple[int, int]] = field(default_factory=dict)  # the first and the last refusal

    def add(self, name: str, now_us: int) -> bool:
        """Count one more; whether to report it, once a run."""
        self.counts[name] += 1
        since_us, last_us = self._runs.get(name, (now_us, now_us))
        if now_us - last_us >= LASTING_US:
            since_us = last_us = now_us
        self._runs[name] = (since_us, now_us)
        return last_us - since_us < LASTING_US <= now_us - since_us
