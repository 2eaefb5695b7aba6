"""Refused messages of the vehicle: counted, and reported when they go on."""

from dataclasses import dataclass, field

from companion.autopilot.known import defaults
from companion.messages import Refused

# One broken packet is a matter for the count. For as long the last setpoint is flown on.
LASTING_US = defaults.LOSS_US


@dataclass(slots=True)
class Run:
    """Refusals of one message with less than LASTING_US between them."""

    since_us: int
    last_us: int
    is_told: bool = False


@dataclass(slots=True)
class Refusals:
    """How often each message was refused, and the present run of each."""

    counts: dict[str, int] = field(default_factory=dict)
    _runs: dict[str, Run] = field(default_factory=dict)

    def add(self, refused: Refused, now_us: int) -> str | None:
        """Count one more; returns the report, once a run."""
        name = refused.message
        self.counts[name] = self.counts.get(name, 0) + 1
        run = self._runs.get(name)
        if run is None or now_us - run.last_us >= LASTING_US:
            run = self._runs[name] = Run(now_us, now_us)
        run.last_us = now_us
        if run.is_told or now_us - run.since_us < LASTING_US:
            return None
        run.is_told = True
        return f"{name} is not accepted: {refused.reason}"
