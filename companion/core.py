"""The pure heart: (core, samples, now) -> messages to send and events. No bytes, no clock, no I/O.

A `Core` belongs to one flight and is changed only by `advance`: the same samples at the same times give the
same outputs, which is what makes a flight replayable.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.detection.interface import Situation
from companion.detection.watch import Watch, start_watch
from companion.estimate.impact import ImpactEstimate
from companion.estimate.resets import Resets
from companion.flight.connecting import Connect
from companion.flight.context import FlightContext, Inputs
from companion.flight.detecting import collisions, follow_contact
from companion.flight.hearing import hear
from companion.flight.leaving_ground import landed, note_height, too_low
from companion.flight.limiting import Limiter
from companion.flight.machine import Machine
from companion.flight.operator import Texts, status_text, values
from companion.flight.outputs import Outputs, collect
from companion.flight.states import FINAL_STATES, State
from companion.link.streams import StreamMonitor
from companion.link.vehicle import Vehicle
from companion.messages import (
    CommandAck,
    LocalPosition,
    OnboardHeartbeat,
    Sample,
)
from companion.mission.model import Mission

# MAVLink's heartbeat microservice: once a second.
HEARTBEAT_INTERVAL_US = 1_000_000
# All timeouts are noticed within this, when nothing arrives.
POLL_INTERVAL_US = 50_000

# Between take-off and landing: the floor counts.
ON_THE_WAY = frozenset({State.MISSION, State.RECOVERING, State.HOLDING, State.RETURNING})
# Off the ground, which is the detector's affair by height, a hit in the climb or the descent is a hit too.
DETECTING_STATES = ON_THE_WAY | {State.TAKEOFF, State.LANDING}


@dataclass(slots=True)
class Core:
    """All that is remembered between steps."""

    flight: FlightContext
    machine: Machine
    watch: Watch
    started_at_us: int
    now_us: int
    heartbeat_due_us: int
    setpoint_due_us: int
    setpoint_interval_us: int
    stop_reason: str | None = None
    values_due_us: int = 0
    limiter: Limiter = field(default_factory=Limiter)
    resets: Resets = field(default_factory=Resets)
    texts: Texts = field(default_factory=Texts)


def start(mission: Mission, now_us: int) -> Core:
    """A flight before its first step."""
    config = mission.companion
    watching = start_watch(config, now_us)
    flight = FlightContext(mission, Vehicle(), StreamMonitor(config.streams, tuple(watching.detector.losses)))
    return Core(
        flight=flight,
        machine=Machine(flight, Connect(now_us)),
        watch=watching,
        started_at_us=now_us,
        now_us=now_us,
        heartbeat_due_us=now_us,
        setpoint_due_us=now_us,
        setpoint_interval_us=round(1e6 / config.flight.setpoint_hz),
    )


def advance(core: Core, samples: Sequence[Sample], now_us: int) -> Outputs:
    """One step: what was heard, whether it shows a hit, what follows for the flight, what is due to be sent."""
    core.now_us = now_us
    moved = react(core, samples, now_us)
    stream_setpoint(core, moved, now_us)
    beat(core, now_us)
    try:
        inform(core, now_us)
    except Exception as error:
        fault(core, error, now_us)
    return collect(core.flight)


def fault(core: Core, error: Exception, now_us: int) -> None:
    """A fault in what leaves a step. The first gives the vehicle away; later ones find that under way."""
    if not core.flight.fault:
        core.machine.fail(error, now_us)


def react(core: Core, samples: Sequence[Sample], now_us: int) -> bool:
    """All that a fault in this program could be in: whatever is raised, the vehicle is handed over, and it is told.

    Heartbeats, setpoints and the log go on meanwhile. After a fault nothing is detected any more.
    """
    try:
        samples = follow_resets(core, samples, now_us)
        refusal = hear(core.flight, samples, now_us)
        note_height(core.flight)
        impacts = () if core.flight.fault else collisions(core.flight, core.watch, samples, situation(core), now_us)
        moved = fly(core, samples, impacts, refusal, now_us)
        follow_contact(core.flight, core.watch)
    except Exception as error:
        return core.machine.fail(error, now_us)
    return moved


def follow_resets(core: Core, samples: Sequence[Sample], now_us: int) -> Sequence[Sample]:
    """The samples in a frame that goes on where the vehicle's own jumps."""
    before = core.resets.shift_ned_m
    samples = core.resets.follow(samples, core.flight.mission.limits.max_step_m)
    jump_m = math.dist(core.resets.shift_ned_m, before)
    if jump_m > 0.0:
        text = f"the vehicle's position was reset by {jump_m:.2f} m: setpoints and obstacles go along"
        core.flight.tell(now_us, "estimate", text, jump_m=round(jump_m, 3))
    return samples


def situation(core: Core) -> Situation:
    """What the flight knows, for the detector."""
    flight = core.flight
    target, goes_down = flight.target, core.machine.state is State.LANDING
    return Situation(
        off_reason=why_not_detecting(core),
        armed=flight.vehicle.armed,
        landed_state=landed(flight, goes_down),
        height_m=flight.height_m,
        descent_commanded=goes_down,
        setpoint_position_ned_m=None if target is None else target.position_ned_m,
    )


def why_not_detecting(core: Core) -> str | None:
    """The ground shakes a vehicle as a hit does, until it has left it and where it goes down to it."""
    state = core.machine.state
    return too_low(core.flight, state is State.LANDING) if state in DETECTING_STATES else state.value


def fly(
    core: Core, samples: Sequence[Sample], impacts: Sequence[ImpactEstimate], refusal: str | None, now_us: int
) -> bool:
    """Let the state machine act; whether it moved."""
    acks = [sample for sample in samples if isinstance(sample, CommandAck)]
    positions = [sample for sample in samples if isinstance(sample, LocalPosition)]
    inputs = Inputs(acks, positions, impacts, core.stop_reason, refusal)
    core.stop_reason = None
    moved = core.machine.step(inputs, now_us)
    flight = core.flight
    if core.machine.finished and flight.ended_at_us is None:
        flight.ended_at_us = now_us
    return moved


def stream_setpoint(core: Core, moved: bool, now_us: int) -> None:
    """The one place setpoints leave from: at their rate, and at once when the flight has moved on."""
    if not moved and now_us < core.setpoint_due_us:
        return
    due_us = core.setpoint_due_us + core.setpoint_interval_us
    core.setpoint_due_us = due_us if not moved and due_us > now_us else now_us + core.setpoint_interval_us
    if not core.flight.vehicle.is_mode_known:
        return
    try:
        wanted = core.machine.activity.target(now_us)
        if wanted is None:
            return
        has_floor = core.machine.state in ON_THE_WAY
        target = core.flight.target = core.limiter.passed(core.flight, wanted, has_floor, moved, now_us)
    except Exception as error:
        fault(core, error, now_us)
        if core.limiter.last is None:
            return
        target = core.flight.target = core.limiter.last.at_rest()
    core.flight.outbox.append(core.resets.sent(target.setpoint(now_us - core.started_at_us)))


def beat(core: Core, now_us: int) -> None:
    """Our own HEARTBEAT, for as long as there is anything to do."""
    if now_us < core.heartbeat_due_us or core.machine.finished:
        return
    core.heartbeat_due_us = now_us + HEARTBEAT_INTERVAL_US
    active = core.machine.state not in FINAL_STATES and core.flight.armed_at_us is not None
    core.flight.outbox.append(OnboardHeartbeat(active))


def inform(core: Core, now_us: int) -> None:
    """The operator's texts, as things happen, and numbers, at their rate; once there is somebody to tell."""
    flight = core.flight
    if flight.vehicle.identity is None or not (flight.events or core.texts.waiting or now_us >= core.values_due_us):
        return
    operator = flight.mission.companion.operator
    hits = len(flight.collisions)
    if operator.status_texts:
        told = [(event.kind, status_text(event, flight.mission.name, hits)) for event in flight.events]
        texts = [(kind, text) for kind, text in told if text is not None]
        flight.outbox += core.texts.due(texts, core.machine.finished, now_us)
    if operator.values_hz and now_us >= core.values_due_us and not core.machine.finished:
        core.values_due_us = now_us + round(1e6 / operator.values_hz)
        latest = flight.collisions[-1] if flight.collisions else None
        flight.outbox += values(core.machine.state, core.watch, latest, hits, now_us - core.started_at_us)


def next_deadline_us(core: Core) -> int:
    """When the next step is due if nothing arrives."""
    if core.stop_reason is not None:
        return core.now_us
    due_us = min(core.heartbeat_due_us, core.now_us + POLL_INTERVAL_US)
    return min(due_us, core.setpoint_due_us) if core.setpoint_due_us > core.now_us else due_us
