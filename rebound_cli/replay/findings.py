"""What a detector made of a flight: impacts with their evidence, when it could not see, what happened around."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.detection.interface import Situation
from companion.detection.watch import Watch
from companion.estimate.impact import ImpactEstimate
from companion.messages import ExtendedState, Heartbeat, LandedState
from companion.px4_mode import mode_name
from rebound_cli.logs.log import Told


@dataclass(slots=True)
class Finding:
    """One impact: as known at once, and as known in the end."""

    at_us: int
    threshold_m_s2: float
    situation: Situation
    first: ImpactEstimate
    final: ImpactEstimate

    @property
    def is_collision(self) -> bool:
        return self.first.impact.is_collision


@dataclass(frozen=True, slots=True)
class Span:
    """A time in which the detector was off or blind, and why at its beginning. Microseconds of the log's clock."""

    start_us: int
    end_us: int
    reason: str

    @property
    def duration_s(self) -> float:
        return (self.end_us - self.start_us) * 1e-6


@dataclass(frozen=True, slots=True)
class Happening:
    """A line of the timeline that is no impact."""

    at_us: int
    text: str


@dataclass(slots=True)
class Findings:
    """Grows step by step."""

    impacts: list[Finding] = field(default_factory=list)
    blind: list[Span] = field(default_factory=list)
    off: list[Span] = field(default_factory=list)
    happenings: list[Happening] = field(default_factory=list)
    flown_us: int = 0  # armed and in the air
    watched_us: int = 0  # of that, with a detector that was on and saw

    @property
    def watched_share(self) -> float | None:
        """How much of the flight a hit would have been seen in; None where nothing was flown."""
        return self.watched_us / self.flown_us if self.flown_us else None

    @property
    def collisions(self) -> list[Finding]:
        return [finding for finding in self.impacts if finding.is_collision]

    @property
    def contacts(self) -> list[Finding]:
        """Touches that are no collisions: landings, hands."""
        return [finding for finding in self.impacts if not finding.is_collision]


class Notebook:
    """Writes findings down as the watch makes them."""

    def __init__(self) -> None:
        self.findings = Findings()
        self._open: dict[str, tuple[int, str]] = {}
        self._off_reason: str | None = None
        self._landed = LandedState.UNDEFINED
        self._armed: bool | None = None
        self._mode: int | None = None
        self._noted_us: int | None = None

    def note(self, watch: Watch, situation: Situation, at_us: int) -> None:
        """After each step: what the watch knows of the latest impact, and whether it sees."""
        estimate, impacts = watch.estimate, self.findings.impacts
        if estimate is not None:
            if not impacts or impacts[-1].first.impact is not estimate.impact:
                impacts.append(Finding(at_us, watch.state.threshold_m_s2, situation, estimate, estimate))
            impacts[-1].final = estimate
        self._note_span("blind", watch.blind_reason, self.findings.blind, at_us)
        if situation.off_reason != self._off_reason:
            self._note_span("off", None, self.findings.off, at_us)
            self._off_reason = situation.off_reason
        self._note_span("off", situation.off_reason, self.findings.off, at_us)
        self._note_share(watch, situation, at_us)

    def _note_share(self, watch: Watch, situation: Situation, at_us: int) -> None:
        elapsed_us = 0 if self._noted_us is None else at_us - self._noted_us
        self._noted_us = at_us
        if not situation.armed or situation.landed_state is LandedState.ON_GROUND:
            return
        self.findings.flown_us += elapsed_us
        if situation.off_reason is None and watch.blind_reason is None:
            self.findings.watched_us += elapsed_us

    def tell(self, at_us: int, text: str) -> None:
        self.findings.happenings.append(Happening(at_us, text))

    def note_samples(self, samples: Sequence[Told], at_us: int) -> None:
        """Take-offs, landings, arming and modes, as the vehicle reports them."""
        for sample in samples:
            if isinstance(sample, ExtendedState):
                self._note_landed(sample.landed_state, at_us)
            elif isinstance(sample, Heartbeat):
                if sample.armed != self._armed and (self._armed is not None or sample.armed):
                    self.tell(at_us, "armed" if sample.armed else "disarmed")
                if sample.custom_mode != self._mode:
                    self.tell(at_us, f"mode {mode_name(sample.custom_mode)}")
                self._armed, self._mode = sample.armed, sample.custom_mode

    def close(self, at_us: int) -> Findings:
        self._note_span("blind", None, self.findings.blind, at_us)
        self._note_span("off", None, self.findings.off, at_us)
        return self.findings

    def _note_landed(self, landed: LandedState, at_us: int) -> None:
        was_down, is_down = self._landed is LandedState.ON_GROUND, landed is LandedState.ON_GROUND
        if was_down and not is_down:
            self.tell(at_us, "took off")
        elif is_down and not was_down and self._landed is not LandedState.UNDEFINED:
            self.tell(at_us, "landed")
        self._landed = landed

    def _note_span(self, name: str, reason: str | None, spans: list[Span], at_us: int) -> None:
        """A span lasts as long as there is a reason and goes by its first: a blind detector's changes its figures."""
        if reason is not None:
            self._open.setdefault(name, (at_us, reason))
        elif name in self._open:
            start_us, first_reason = self._open.pop(name)
            spans.append(Span(start_us, at_us, first_reason))
