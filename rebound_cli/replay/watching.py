"""A log through the watch: the same detector code as in flight, at the recorded or at a requested rate."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from companion import messages
from companion.core import POLL_INTERVAL_US
from companion.link.vehicle import OLD_NEWS_US
from companion.mission.config import CompanionConfig
from companion.px4_mode import AUTO_LAND, mode_name
from companion.reflex.detector import Situation
from companion.reflex.impact import ImpactEstimate
from companion.reflex.monitor import CollisionMonitor, advance, start_monitor
from rebound_cli.logs.log import Demand, Log, LoggedSample
from sim_vehicle.mavlink.streams.streams import KINDS, Stream, interval_from_request

# In a gap of the log the watch is asked this often, as a flight would, and then no more: it has told by then.
_MOST_POLLS = 20
# AUTO.PRECLAND
_AUTO_PRECLAND = 4 << 16 | 9 << 24
# From this downward speed asked for PX4's land detector takes a descent to be meant: 1.1 x LNDMC_Z_VEL_MAX, 0.25 m/s
# (land_detector/MulticopterLandDetector.cpp).
DESCENT_M_S = 0.275
# MANUAL, ACRO, STABILIZED, RATTITUDE: the sticks ask for an attitude or for rates, and position control is off
# (commander/ModeUtil/control_mode.cpp). It is taken to act where the mode is unknown.
_BY_STICKS_ALONE = (1, 5, 7, 8)
_NO_DEMAND = Demand(0, None, None, None)


class Circumstances:
    """What a flight would have known at each moment of a foreign log; the pilot's plan is known from modes alone.

    Takes every sample; `situation` is what they add up to.
    """

    def __init__(self) -> None:
        self.situation = Situation()
        self._armed: bool | None = None
        self._landed = messages.LandedState.UNDEFINED
        self._mode = 0
        self._told_mode: int | None = None  # in a heartbeat
        self._down_m: float | None = None
        self._ground_down_m: float | None = None
        self._demand = _NO_DEMAND
        self._demand_old_us = 0  # from then on it is no longer flown, unless it is renewed

    def hear(self, heard: LoggedSample) -> Sequence[str]:
        """Take-offs, landings, arming and modes, as the sample reports them."""
        happened: list[str] = []
        match heard.sample:
            case messages.LocalPosition(position_ned_m=(_, _, down_m)):
                self._down_m = down_m
                is_down = self._landed is messages.LandedState.ON_GROUND or self._armed is False
                if self._ground_down_m is None and is_down:
                    self._ground_down_m = down_m
            case messages.Heartbeat(armed=armed, custom_mode=mode):
                # Heights count from the place of arming, which is where the vehicle stands when it is armed.
                if armed and self._armed is False:
                    self._ground_down_m = self._down_m
                if armed != self._armed and (armed or self._armed is not None):
                    happened.append("armed" if armed else "disarmed")
                if mode != self._told_mode:
                    happened.append(f"mode {mode_name(mode)}")
                self._armed, self._mode, self._told_mode = armed, mode, mode
            case messages.CurrentMode(custom_mode=mode):
                self._mode = mode
            case messages.ExtendedState(landed_state=landed):
                was_down, is_down = (state is messages.LandedState.ON_GROUND for state in (self._landed, landed))
                if was_down != is_down and self._landed is not messages.LandedState.UNDEFINED:
                    happened.append("landed" if is_down else "took off")
                self._landed = landed
            case Demand() as demand:
                # PX4 keeps OFFBOARD for so long without a setpoint (COM_OF_LOSS_T); logs hold five in a second.
                self._demand, self._demand_old_us = demand, heard.at_us + OLD_NEWS_US
            case _:
                return ()
        self._add_up()
        return happened

    def wait(self, now_us: int) -> None:
        """Time has passed: a setpoint that nobody renewed is no longer flown."""
        if self._demand is not _NO_DEMAND and now_us >= self._demand_old_us:
            self._demand = _NO_DEMAND
            self._add_up()

    def _add_up(self) -> None:
        # The setpoint, in a mode that flies it.
        flown = _NO_DEMAND if self._mode >> 16 & 0xFF in _BY_STICKS_ALONE else self._demand
        is_landing = self._mode in (AUTO_LAND, _AUTO_PRECLAND) or self._landed is messages.LandedState.LANDING
        height_m = None
        if self._down_m is not None and self._ground_down_m is not None:
            height_m = self._ground_down_m - self._down_m
        self.situation = Situation(
            off_reason="disarmed" if self._armed is False else None,
            armed=self._armed,
            landed_state=self._landed,
            height_m=height_m,
            descent_commanded=is_landing or (flown.velocity_down_m_s or 0.0) >= DESCENT_M_S,
            setpoint_position_ned_m=flown.position_ned_m,
        )


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
    _open: dict[str, tuple[int, str]] = field(default_factory=dict)
    _noted_us: int | None = None

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

    def note(self, monitor: CollisionMonitor, situation: Situation, at_us: int) -> None:
        """After each step: what the watch knows of the latest impact, and whether it sees."""
        estimate, off = monitor.estimator.estimate, situation.off_reason
        if estimate is not None:
            if not self.impacts or self.impacts[-1].first.impact is not estimate.impact:
                self.impacts.append(Finding(at_us, monitor.state.threshold_m_s2, situation, estimate, estimate))
            self.impacts[-1].final = estimate
        self._note_span("blind", monitor.no_data_reason, at_us)
        if off != self._open.get("off", (0, None))[1]:
            self._note_span("off", None, at_us)
        self._note_span("off", off, at_us)
        elapsed_us = 0 if self._noted_us is None else at_us - self._noted_us
        self._noted_us = at_us
        if situation.armed and situation.landed_state is not messages.LandedState.ON_GROUND:
            self.flown_us += elapsed_us
            self.watched_us += elapsed_us if off is None and monitor.no_data_reason is None else 0

    def _note_span(self, name: str, reason: str | None, at_us: int) -> None:
        """A span lasts as long as there is a reason and goes by its first: a blind detector's changes its figures."""
        if reason is not None:
            self._open.setdefault(name, (at_us, reason))
        elif name in self._open:
            start_us, first_reason = self._open.pop(name)
            (self.blind if name == "blind" else self.off).append(Span(start_us, at_us, first_reason))

    def tell(self, at_us: int, text: str) -> None:
        self.happenings.append(Happening(at_us, text))

    def close(self, at_us: int) -> None:
        self._note_span("blind", None, at_us)
        self._note_span("off", None, at_us)


def watch_log(
    log: Log,
    config: CompanionConfig,
    rate_hz: float | None = None,
    listen: Callable[[CollisionMonitor], None] | None = None,
) -> Findings:
    """Everything heard, in its order; `rate_hz` is what HIGHRES_IMU is asked for, None for what was recorded.

    `listen` is told of the watch before its first sample.
    """
    heard = log.heard if rate_hz is None else tuple(thinned(log.heard, rate_hz))
    circumstances, findings = Circumstances(), Findings()
    # A log begins with old news of every topic: until the first IMU sample no detector was armed.
    start_us = last_us = next(item.at_us for item in heard if isinstance(item.sample, messages.ImuSample))
    monitor = start_monitor(config, start_us)
    if listen is not None:
        listen(monitor)

    def step(samples: Sequence[messages.Sample], now_us: int) -> None:
        for notice in advance(monitor, samples, circumstances.situation, now_us).notices:
            findings.tell(now_us, notice.text)
        findings.note(monitor, circumstances.situation, now_us)

    for at_us, group in groupby(heard, key=lambda item: max(item.at_us, start_us)):
        last_poll_us = min(at_us, last_us + _MOST_POLLS * POLL_INTERVAL_US)
        for poll_us in range(last_us + POLL_INTERVAL_US, last_poll_us, POLL_INTERVAL_US):
            circumstances.wait(poll_us)
            step((), poll_us)
        items = list(group)
        for item in items:
            for text in circumstances.hear(item):
                findings.tell(at_us, text)
        circumstances.wait(at_us)
        # One by one: two impacts of one instant would otherwise be one.
        for item in items:
            if not isinstance(item.sample, Demand):
                step((item.sample,), at_us)
        last_us = at_us
    findings.close(last_us)
    return findings


def thinned(heard: tuple[LoggedSample, ...], rate_hz: float) -> Iterator[LoggedSample]:
    """What PX4's link would have sent of the IMU samples, asked for this rate; all other samples as they are.

    A sample stays the mean over its own interval: a lower rate does not average, it leaves samples out.
    """
    kind = next(kind for kind in KINDS if kind.message_id == messages.MessageId.HIGHRES_IMU)
    stream = Stream(kind, heard[0].at_us)
    stream.set_interval(interval_from_request(1e6 / rate_hz))
    for item in heard:
        if isinstance(item.sample, messages.ImuSample):
            if item.at_us <= stream.due_after_us:
                continue
            stream.sent(item.at_us)
        yield item
