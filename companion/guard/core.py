"""The guard's pure heart: (core, samples, now) -> messages to send and events. No bytes, no clock, no I/O."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.detection.interface import Situation
from companion.detection.watch import Watch, start_watch
from companion.estimate.impact import ImpactEstimate
from companion.flight.context import FlightContext, Inputs
from companion.flight.detecting import collisions, follow_contact
from companion.flight.hearing import hear
from companion.flight.leaving_ground import note_height, too_low
from companion.flight.limiting import Limiter
from companion.flight.operator import status_text, values
from companion.flight.outputs import Outputs, collect
from companion.guard.config import GuardConfig
from companion.guard.context import GuardContext, GuardInputs
from companion.guard.machine import GuardMachine
from companion.guard.states import HOLDING, State
from companion.guard.watching import Connect, why_not
from companion.link.streams import StreamMonitor
from companion.link.vehicle import Vehicle
from companion.messages import (
    CommandAck,
    GlobalPosition,
    LocalPosition,
    OnboardHeartbeat,
    PositionTarget,
    Sample,
    Sticks,
)

# MAVLink's heartbeat microservice: once a second.
HEARTBEAT_INTERVAL_US = 1_000_000
# All timeouts are noticed within this, when nothing arrives.
POLL_INTERVAL_US = 50_000


@dataclass(slots=True)
class GuardCore:
    """All that is remembered between steps."""

    machine: GuardMachine
    watch: Watch
    started_at_us: int
    now_us: int
    heartbeat_due_us: int
    setpoint_due_us: int
    values_due_us: int
    stop_reason: str | None = None
    is_enabled: bool = False  # asked for, and not yet taken up
    limiter: Limiter = field(default_factory=Limiter)

    @property
    def guard(self) -> GuardContext:
        return self.machine.guard

    @property
    def flight(self) -> FlightContext:
        return self.machine.guard.flight


def start(config: GuardConfig, keeps_others_out: bool, now_us: int) -> GuardCore:
    """A guard before its first step. `keeps_others_out`: see GuardContext."""
    companion = config.companion
    watching = start_watch(companion, now_us)
    streams = StreamMonitor(companion.streams, tuple(watching.detector.losses))
    flight = FlightContext(config.as_mission(), Vehicle(), streams)
    machine = GuardMachine(GuardContext(config, flight, keeps_others_out), Connect(now_us))
    return GuardCore(machine, watching, now_us, now_us, now_us, now_us, now_us)


def advance(core: GuardCore, samples: Sequence[Sample], now_us: int) -> Outputs:
    """One step: what was heard, whether it shows a hit, what follows, what is due to be sent."""
    core.now_us = now_us
    moved = react(core, samples, now_us)
    stream_setpoint(core, moved, now_us)
    beat(core, now_us)
    try:
        inform(core, now_us)
    except Exception as error:
        fault(core, error, now_us)
    return collect(core.flight)


def fault(core: GuardCore, error: Exception, now_us: int) -> None:
    """A fault in what leaves a step. The first gives the vehicle away; later ones find that under way."""
    if not core.flight.fault:
        core.machine.fail(error, now_us)


def react(core: GuardCore, samples: Sequence[Sample], now_us: int) -> bool:
    """All that a fault in this program could be in: whatever is raised, the vehicle is given back, and it is told."""
    try:
        refusal = hear(core.flight, samples, now_us)
        place_origin(core.flight, core.guard)
        note_height(core.flight)
        impacts = () if core.flight.fault else collisions(core.flight, core.watch, samples, situation(core), now_us)
        moved = act(core, samples, impacts, refusal, now_us)
        follow_contact(core.flight, core.watch)
    except Exception as error:
        return core.machine.fail(error, now_us)
    return moved


def place_origin(flight: FlightContext, guard: GuardContext) -> None:
    """The fence and the heights begin where the vehicle stands until it is armed.

    Of one met in the air only the zero of its own local frame is known, which is where its estimator began.
    """
    latest = flight.vehicle.history.latest()
    if flight.vehicle.armed is False:
        flight.origin_ned_m = None if latest is None else latest.position_ned_m
        guard.hits, guard.program_elsewhere = 0, False
    elif flight.origin_ned_m is None and latest is not None:
        flight.origin_ned_m = (latest.position_ned_m[0], latest.position_ned_m[1], 0.0)


def situation(core: GuardCore) -> Situation:
    """What the guard knows, for the detector; of a stranger's setpoints it knows nothing."""
    flight = core.flight
    target = flight.target if core.machine.state in HOLDING else None
    return Situation(
        off_reason=why_not_detecting(core),
        armed=flight.vehicle.armed,
        landed_state=flight.vehicle.landed,
        height_m=flight.height_m,
        setpoint_position_ned_m=None if target is None else target.position_ned_m,
    )


def why_not_detecting(core: GuardCore) -> str | None:
    """Ground, take-off and landing shake a vehicle as a hit does."""
    state = core.machine.state
    if state is not State.WATCHING and state not in HOLDING:
        return why_not(core.guard) or state.value
    return too_low(core.flight, False)


def act(
    core: GuardCore, samples: Sequence[Sample], impacts: Sequence[ImpactEstimate], refusal: str | None, now_us: int
) -> bool:
    """Let the state machine act; whether it moved."""
    sticks = [sample for sample in samples if isinstance(sample, Sticks)]
    if sticks and core.machine.state not in HOLDING:
        core.guard.sticks = sticks[-1]
    places = [sample for sample in samples if isinstance(sample, GlobalPosition)]
    if places:
        core.guard.global_position = places[-1]
    inputs = GuardInputs(
        Inputs(
            acks=[sample for sample in samples if isinstance(sample, CommandAck)],
            positions=[sample for sample in samples if isinstance(sample, LocalPosition)],
            impacts=impacts,
            stop_reason=core.stop_reason,
            refusal=refusal,
        ),
        echoes=[sample for sample in samples if isinstance(sample, PositionTarget)],
        sticks=sticks,
        is_enabled=core.is_enabled,
    )
    core.is_enabled = False
    return core.machine.step(inputs, now_us)


def stream_setpoint(core: GuardCore, moved: bool, now_us: int) -> None:
    """The one place setpoints leave from: at their rate, and at once when the guard has moved on."""
    if not moved and now_us < core.setpoint_due_us:
        return
    config, is_ours = core.guard.config, core.machine.holds
    rate_hz = config.companion.flight.setpoint_hz if is_ours else config.lead_hz
    core.setpoint_due_us = now_us + round(1e6 / rate_hz)
    if not core.flight.vehicle.is_mode_known:
        return
    try:
        wanted = core.machine.activity.target(now_us)
        if wanted is None:
            return
        # What leads the way is the place of a vehicle that others fly, wherever they fly it.
        target = core.limiter.passed(core.flight, wanted, True, moved, now_us) if is_ours else wanted
    except Exception as error:
        fault(core, error, now_us)
        if not is_ours or core.limiter.last is None:
            return
        target = core.limiter.last.at_rest()
    if is_ours:
        core.flight.target = target
        core.guard.sent_ned_m.append((now_us, None if target.leans_only else target.position_ned_m))
    core.flight.outbox.append(target.setpoint(now_us - core.started_at_us))


def beat(core: GuardCore, now_us: int) -> None:
    """Our own HEARTBEAT, for as long as there is anything to do."""
    if now_us < core.heartbeat_due_us or core.machine.state is State.ENDED:
        return
    core.heartbeat_due_us = now_us + HEARTBEAT_INTERVAL_US
    core.flight.outbox.append(OnboardHeartbeat(core.machine.state is not State.CONNECTING))


def inform(core: GuardCore, now_us: int) -> None:
    """The operator's texts, as things happen, and numbers, at their rate; once there is somebody to tell."""
    flight, operator = core.flight, core.guard.config.companion.operator
    if flight.vehicle.identity is None:
        return
    hits = len(flight.collisions)
    if operator.status_texts:
        texts = [status_text(event, flight.mission.name, hits) for event in flight.events]
        flight.outbox += [text for text in texts if text is not None]
    if operator.values_hz and now_us >= core.values_due_us and core.machine.state is not State.ENDED:
        core.values_due_us = now_us + round(1e6 / operator.values_hz)
        latest = flight.collisions[-1] if flight.collisions else None
        flight.outbox += values(core.machine.state, core.watch, latest, hits, now_us - core.started_at_us)


def next_deadline_us(core: GuardCore) -> int:
    """When the next step is due if nothing arrives."""
    if core.stop_reason is not None and core.machine.state is not State.ENDED:
        return min(core.now_us + POLL_INTERVAL_US, core.setpoint_due_us)
    due_us = min(core.heartbeat_due_us, core.now_us + POLL_INTERVAL_US)
    return min(due_us, core.setpoint_due_us) if core.setpoint_due_us > core.now_us else due_us
