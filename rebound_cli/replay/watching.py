"""A log through the watch: the same detector code as in flight."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import groupby

from companion import messages
from companion.flight.context import Inputs
from companion.flight.core import POLL_INTERVAL_US
from companion.flight.handlers.crash import Crashed, crashed
from companion.flight.vehicle_update import note_height, situation_of
from companion.guard.config import GuardConfig
from companion.guard.context import GuardContext
from companion.guard.states import State
from companion.guard.watching import goes_down, not_flying, observe, why_not
from companion.mission.config import CompanionConfig
from companion.reflex.detection.detector import Impact, ImpactKind, Situation
from companion.reflex.detection.health import Promise
from companion.reflex.detection.impact import ImpactEstimate
from companion.reflex.detection.monitor import CollisionMonitor, advance, start_monitor
from rebound_cli.logs.log import Log
from rebound_cli.replay.listening import Listener

# In a gap of the log the watch is asked this often, as a flight would, and then no more: it has told by then.
_MOST_POLLS = 20
# Of the guard's own events these tell what the vehicle did.
_TOLD = ("mode", "disarmed", "implausible", "crashed", "warning")


class Circumstances:
    """What a guard would have known at each moment of a foreign log, by the guard's own code.

    Takes every sample; `situation` is what they add up to. The guard may take over in `modes`; None: in all.
    """

    def __init__(self, config: CompanionConfig, modes: Sequence[str] | None = None) -> None:
        self._why_not = not_flying if modes is None else why_not
        settings = GuardConfig.model_construct(companion=config, modes=tuple(modes or ()))
        self.guard = GuardContext(settings.as_mission(), config=settings, keeps_others_out=False)
        self._now_us = 0
        self._wreck: Crashed | None = None

    def hear(self, told: Sequence[messages.Sample], now_us: int) -> Sequence[str]:
        """Take-offs, landings, arming and modes, as the samples report them."""
        guard, self._now_us = self.guard, now_us
        vehicle = guard.vehicle
        armed, landed = vehicle.armed, vehicle.landed
        observe(guard, told, now_us)
        note_height(guard)
        guard.reflex.crash.update(told, guard.height_m, vehicle.landed)
        if self._wreck is not None and guard.is_wreck:
            self._wreck.step(guard, Inputs(), now_us)
        elif crashed(guard, goes_down(guard, now_us), now_us) is not None:
            self._wreck = Crashed(guard, now_us)
        happened = [event.text for event in guard.events if event.kind in _TOLD]
        if vehicle.armed and armed is not True:
            happened.append("armed")
        on_ground = messages.LandedState.ON_GROUND
        if landed is not messages.LandedState.UNDEFINED and (landed is on_ground) is not (vehicle.landed is on_ground):
            happened.append("landed" if vehicle.landed is on_ground else "took off")
        guard.events, guard.outbox = [], []
        return happened

    def note(self, impacts: Sequence[ImpactEstimate]) -> None:
        """What the detector has reported."""
        if any(estimate.impact.is_ground for estimate in impacts):
            self.guard.note_touchdown()

    @property
    def situation(self) -> Situation:
        guard = self.guard
        off = self._why_not(guard) or (State.CRASHED.value if guard.is_wreck else None)
        return situation_of(guard, off, goes_down(guard, self._now_us), is_held=False)


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

    @property
    def is_crash(self) -> bool:
        return self.first.impact.kind is ImpactKind.CRASH


@dataclass(frozen=True, slots=True)
class Span:
    """A time in which the detector was off or blind, and why at its beginning. Microseconds of the log's clock."""

    start_us: int
    end_us: int
    reason: str

    @property
    def duration_s(self) -> float:
        return (self.end_us - self.start_us) * 1e-6


@dataclass(slots=True)
class Findings:
    """Grows step by step. `listener` has heard what the detector made of each sample."""

    impacts: list[Finding] = field(default_factory=list)
    blind: list[Span] = field(default_factory=list)
    off: list[Span] = field(default_factory=list)
    happenings: list[tuple[int, str]] = field(default_factory=list)  # the timeline without impacts: when and what
    flown_us: int = 0  # armed and in the air
    watched_us: int = 0  # of that, with a detector that was on and saw
    promised: float = 0.0  # false alarms in that time, by the detector's own statistic
    promise: Promise | None = None  # when it was last armed
    is_flying: bool = False  # armed and in the air at the end
    listener: Listener = field(default_factory=Listener)
    _open: dict[str, tuple[int, str]] = field(default_factory=dict)
    _latest: Impact | None = None
    _noted_us: int | None = None

    @property
    def watched_share(self) -> float | None:
        """How much of the flight a hit would have been seen in; None where nothing was flown."""
        return self.watched_us / self.flown_us if self.flown_us else None

    @property
    def collisions(self) -> list[Finding]:
        """Hits, crashes among them."""
        return [finding for finding in self.impacts if finding.is_collision]

    @property
    def crashes(self) -> list[Finding]:
        """Those that end on the ground."""
        return [finding for finding in self.impacts if finding.is_crash]

    @property
    def contacts(self) -> list[Finding]:
        """Touches that are no collisions: landings, hands."""
        return [finding for finding in self.impacts if not finding.is_collision]

    def note(
        self,
        monitor: CollisionMonitor,
        estimate: ImpactEstimate | None,
        situation: Situation,
        is_flying: bool,
        at_us: int,
    ) -> None:
        """After each step: what the watch knows of the latest impact, and whether it sees."""
        off = situation.off_reason
        if estimate is not None and estimate.impact is not self._latest:
            self._latest = estimate.impact
            if not situation.is_wreck:
                self.impacts.append(Finding(at_us, monitor.state.threshold_m_s2, situation, estimate, estimate))
        if estimate is not None and self.impacts and self.impacts[-1].first.impact is estimate.impact:
            self.impacts[-1].final = estimate
        self._note_span("blind", monitor.no_data_reason, at_us)
        if off != self._open.get("off", (0, None))[1]:
            self._note_span("off", None, at_us)
        self._note_span("off", off, at_us)
        elapsed_us = 0 if self._noted_us is None else at_us - self._noted_us
        self._noted_us = at_us
        self.is_flying = is_flying
        if self.is_flying:
            self.flown_us += elapsed_us
            if off is None and monitor.no_data_reason is None:
                self.watched_us += elapsed_us
                self.promise = monitor.promise
                self.promised += elapsed_us / 3.6e9 * (monitor.promise.false_alarms_per_h if monitor.promise else 0.0)

    def _note_span(self, name: str, reason: str | None, at_us: int) -> None:
        """A span lasts as long as there is a reason and goes by its first: a blind detector's changes its figures."""
        if reason is not None:
            self._open.setdefault(name, (at_us, reason))
        elif name in self._open:
            start_us, first_reason = self._open.pop(name)
            (self.blind if name == "blind" else self.off).append(Span(start_us, at_us, first_reason))

    def close(self, at_us: int) -> None:
        self._note_span("blind", None, at_us)
        self._note_span("off", None, at_us)


def watch_log(log: Log, config: CompanionConfig, modes: Sequence[str] | None = None) -> Findings:
    """Everything heard, in its order. `modes`: see `Circumstances`."""
    circumstances, findings = Circumstances(config, modes), Findings()
    # A log begins with old news of every topic: until the first IMU sample no detector was armed.
    start_us = last_us = next(item.at_us for item in log.heard if isinstance(item.sample, messages.ImuSample))
    monitor = start_monitor(sampled_as(log, config), start_us)
    monitor.estimator.hides_clipping = log.is_filtered
    findings.listener.listen(monitor)

    def step(samples: Sequence[messages.Sample], now_us: int) -> None:
        situation = circumstances.situation
        impacts, notices = advance(monitor, samples, situation, now_us)
        for notice in notices:
            findings.happenings.append((now_us, notice.text))
        is_flying = circumstances.guard.vehicle.is_airborne
        findings.note(monitor, monitor.estimator.estimate, situation, is_flying, now_us)
        circumstances.note(impacts)

    for at_us, group in groupby(log.heard, key=lambda item: max(item.at_us, start_us)):
        last_poll_us = min(at_us, last_us + _MOST_POLLS * POLL_INTERVAL_US)
        for poll_us in range(last_us + POLL_INTERVAL_US, last_poll_us, POLL_INTERVAL_US):
            circumstances.hear((), poll_us)
            step((), poll_us)
        told = [item.sample for item in group]
        for text in circumstances.hear(told, at_us):
            findings.happenings.append((at_us, text))
        # One by one: two impacts of one instant would otherwise be one.
        for sample in told:
            step((sample,), at_us)
        last_us = at_us
    findings.close(last_us)
    return findings


def sampled_as(log: Log, config: CompanionConfig) -> CompanionConfig:
    """With the time that a sample of this log's source looks back over."""
    if log.low_pass_hz is None or log.window_us is None:
        return config
    estimate = config.estimate.model_copy(update={"imu_averaging_interval_s": log.window_us * 1e-6})
    return config.model_copy(update={"estimate": estimate})
