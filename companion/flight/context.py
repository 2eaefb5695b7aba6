"""What the parts of a flight share: the mission, the vehicle's state, messages to send and events."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Generic, NamedTuple, TypeVar

from companion.autopilot.known import defaults
from companion.flight.states import Trigger
from companion.link.commands import CommandClient, CommandOutcome
from companion.link.refusals import Refusals
from companion.link.round_trip import RoundTrip
from companion.link.streams import StreamMonitor
from companion.link.vehicle import OLD_NEWS_US, Vehicle
from companion.memory.surroundings import ObstacleMap
from companion.messages import CommandAck, CurrentMode, LocalPosition, Outgoing, PositionSetpoint, Setpoint, Vector3
from companion.mission.item_trajectory import SpeedLimits
from companion.mission.items import ExpectItem, Motion, Step
from companion.mission.model import Mission, steps_to_fly
from companion.motion.motors import MotorWatch
from companion.motion.settling import Lasting
from companion.motion.vector import ZERO, minus, plus
from companion.reflex.detection.impact import ImpactEstimate
from companion.reflex.recovery.attitude_law import Lean
from companion.reflex.recovery.collision import Collision
from companion.reflex.reflex import Reflex
from companion.report import Event, ExpectationReport, JsonValue, Outcome

# Two setpoints ahead of the mode that needs them: PX4 takes OFFBOARD once it has heard one.
LEAD_US = 40_000
# As the autopilot's own modes turn: the vehicle can follow.
TURNING_RAD_S = math.radians(defaults.TURNING_DEG_S)


@dataclass(frozen=True, slots=True)
class Target:
    """The setpoint to be sent; local NED. Without a velocity the vehicle stops at the position.

    With a `lean` the acceleration is sent as attitude and thrust. The position is then where the vehicle is to rest.
    """

    position_ned_m: Vector3
    yaw_rad: float | None
    velocity_ned_m_s: Vector3 | None = None
    acceleration_ned_m_s2: Vector3 | None = None
    lean: Lean | None = None

    def at_rest(self) -> "Target":
        """The position alone, which PX4 can hold without further setpoints."""
        return Target(self.position_ned_m, self.yaw_rad)

    def setpoint(self, time_us: int) -> Setpoint:
        if self.lean is not None and self.acceleration_ned_m_s2 is not None:
            return self.lean.setpoint(time_us, self.acceleration_ned_m_s2)
        velocity, acceleration = self.velocity_ned_m_s, self.acceleration_ned_m_s2
        return PositionSetpoint(time_us, self.position_ned_m, self.yaw_rad, velocity, acceleration)


@dataclass(frozen=True, slots=True)
class Transition:
    """A trigger, of the flight's table or the guard's, and its reason; "" where the state reports its own events.

    `is_left`: a flight that ends by it in the air does not hand the vehicle over: another has it, or it lands.
    """

    trigger: Enum
    text: str = ""
    is_left: bool = False


class Inputs(NamedTuple):
    """Inputs of one step besides the vehicle's state. A tuple, because one is made in every step."""

    acks: Sequence[CommandAck] = ()
    positions: Sequence[LocalPosition] = ()
    impacts: Sequence[ImpactEstimate] = ()
    stop_reason: str | None = None
    refusal: str | None = None  # why the other end cannot be flown
    is_enabled: bool = False  # a guard that stood down, by a person


@dataclass(slots=True)
class StepTally:
    """Counts of the present mission step; reset by the next one."""

    index: int = 0
    began_us: int | None = None
    hits: int = 0
    pace_factor: float = 1.0
    left: Motion | None = None  # of the item's motion, when it was interrupted


@dataclass(frozen=True, slots=True)
class BeforeHit:
    """The state before a hit, restored where the hit is rejected."""

    way_back: Transition
    step_index: int
    tally: StepTally
    after_recovery: Transition


@dataclass(slots=True)
class Expectation:
    """An assertion of the mission's: pending until it is known whether it is met."""

    item: ExpectItem
    began_us: int
    hits_before: int
    report: ExpectationReport


@dataclass(slots=True)
class FlightContext:
    """The flight's shared state. Only the flight's parts change it, within a step."""

    mission: Mission
    vehicle: Vehicle = field(default_factory=Vehicle)
    streams: StreamMonitor = field(init=False)
    reflex: Reflex = field(init=False)
    command_client: CommandClient = field(default_factory=CommandClient)
    events: list[Event] = field(default_factory=list)
    outbox: list[Outgoing] = field(default_factory=list)
    was_silent: bool = False  # since the streams were asked for; if it was restarted meanwhile it has forgotten them
    target: Target | None = None  # as last streamed
    origin_ned_m: Vector3 | None = None
    stepped_us: int | None = None  # when the step before was
    missed_us: int = 0  # since the last position: the delay of late steps, in which nothing was received
    trajectory_us: int = 0  # the trajectories' clock: it stops while no position comes
    has_position: bool = True  # one came within the detector's `silence_s`; without, trajectories stand still
    yaw_rad: float | None = None
    expected_mode: int | None = None  # the mode the companion has been seen to hold
    foreign_mode_since_us: int | None = None  # when the mode was first not ours, though perhaps nobody decided it
    armed_at_us: int | None = None
    steps: tuple[Step, ...] = field(init=False)
    step_index: int = 0  # the one that is flown, or is to be flown next
    tally: StepTally = field(default_factory=StepTally)
    speeds: SpeedLimits = field(init=False)
    after_recovery: Transition = Transition(Trigger.RECOVERED_TO_HOLD)  # decided at the hit
    going_home: bool = False
    is_landing: bool = False  # ordered, and begun again after every hit on the way down
    file_awaited: str | None = None  # until it is there
    expectations: list[Expectation] = field(default_factory=list)
    before_hit: BeforeHit | None = None
    unconfirmed: int = 0  # hits of which nothing but one sample spoke
    refusals: Refusals = field(default_factory=Refusals)
    round_trip: RoundTrip = field(default_factory=RoundTrip)
    known: ObstacleMap = field(init=False)  # of the surroundings, mission coordinates
    unreachable: list[str] = field(default_factory=list)
    crashed: str = ""  # how, once it has
    is_wreck: bool = False  # since then, until it is disarmed or flies again
    motors: MotorWatch = field(default_factory=MotorWatch)
    flies: bool = False  # armed, and off the ground or about to be
    flew_us: int | None = None  # when it last did
    may_crash: bool = False  # flies, or did a moment ago: whose motors stop in the air says at once that it has landed
    height_m: float | None = None  # above the arming position, where that and a place of late are known
    has_climbed: bool = False  # has been higher than `min_detection_height_m` since it stood on the ground
    blind: Lasting = field(default_factory=Lasting)  # the detector, while it is on
    plan_confirmed: bool = False
    stop_put_off: str | None = None  # the reason of a stop that waits until the vehicle is clear of what it has hit
    is_stop_asked: bool = False  # by a person
    outcome: Outcome | None = None
    reason: str = ""
    fault: str = ""  # of this program

    def __post_init__(self) -> None:
        config = self.mission.companion
        self.reflex = Reflex(config, self.mission.recovery, config.settled)
        self.streams = StreamMonitor(config.streams, tuple(self.reflex.monitor.detector.losses))
        self.speeds = self.mission.speeds
        self.steps = steps_to_fly(self.mission)
        self.known = self.mission.known

    @property
    def step(self) -> Step:
        return self.steps[self.step_index]

    @property
    def latest(self) -> LocalPosition:
        latest = self.vehicle.history.latest
        assert latest is not None, "a flight begins only with positions arriving"
        return latest

    @property
    def is_retry(self) -> bool:
        """Whether the present item is tried again after a hit."""
        is_asked = self.after_recovery.trigger is Trigger.RECOVERED_TO_RETRY
        return is_asked and self.tally.hits > 0 and not self.going_home

    @property
    def collisions(self) -> list[Collision]:
        """All so far."""
        return self.reflex.hits

    @property
    def hits(self) -> list[Collision]:
        """Those since it was armed."""
        return self.reflex.hits[self.motors.earlier_hits :]

    def note_touchdown(self) -> None:
        """The vehicle has met the ground, and bounces or slides along it until it has climbed again."""
        self.has_climbed = False

    def heading_towards(self, rate_rad_s: float = TURNING_RAD_S) -> float | None:
        """The heading to ask for on the way to the wanted one: it leads the vehicle's own by what turns it at a rate.

        Motors that turn a vehicle as fast as they can have no thrust left to climb with. One that something holds they
        turn over it.
        """
        wanted_rad, heading_rad = self.yaw_rad, self.vehicle.heading_rad
        lead_rad = rate_rad_s / defaults.YAW_GAIN_PER_S
        if wanted_rad is None or heading_rad is None:
            return wanted_rad
        short_rad = math.remainder(wanted_rad - heading_rad, math.tau)
        return wanted_rad if abs(short_rad) <= lead_rad else heading_rad + math.copysign(lead_rad, short_rad)

    def report(self, now_us: int, kind: str, text: str, **data: JsonValue) -> None:
        self.events.append(Event(now_us, kind, text, data))

    @property
    def own_modes(self) -> tuple[int | None, ...]:
        """The modes that mean that the companion has the vehicle; none while it does not hold it."""
        return () if self.expected_mode is None else (self.expected_mode, self.command_client.requested_mode)

    def silent_s(self, now_us: int) -> float:
        return (now_us - self.vehicle.last_received_us) * 1e-6

    def is_silent(self, now_us: int) -> bool:
        """Whether an identified vehicle has been silent for longer than `link.silence_s`."""
        return self.vehicle.identity is not None and self.silent_s(now_us) > self.mission.companion.link.silence_s

    def may_command(self, now_us: int) -> bool:
        """Whether a held vehicle may be sent a command: not on an old report, as the pilot may have changed the mode.

        Into a silence it is sent once. A link cut in one direction delivers it; one cut in both loses it. A command
        that is not repeated does not arrive after a pilot's takeover.
        """
        if self.expected_mode is None or self.vehicle.is_mode_known:
            return True
        is_silent = now_us - self.vehicle.last_received_us >= OLD_NEWS_US
        is_unsaid = self.command_client.pending is not None and self.command_client.attempts == 0
        return is_silent and self.vehicle.unconfirmed_mode is None and is_unsaid

    def ask_for_mode(self, custom_mode: int) -> None:
        self.command_client.begin(self.vehicle.autopilot.set_mode(custom_mode))

    def count_asked_mode(self) -> None:
        """The vehicle is about to be in the mode that it was asked for: no report of before says otherwise."""
        if (asked := self.command_client.requested_mode) is not None:
            self.expected_mode = asked
            self.vehicle.count_mode(CurrentMode(asked, None))

    def command_outcome(self, inputs: Inputs, seen: bool, now_us: int) -> CommandOutcome | None:
        """Advance the command client; report a failure."""
        send, outcome = self.command_client.step(inputs.acks, seen, now_us, self.may_command(now_us))
        if send is not None:
            self.outbox.append(send)
        if outcome is not None and not outcome.succeeded:
            self.report(now_us, "command", outcome.text)
        return outcome

    def local_ned_m(self, mission_ned_m: Vector3) -> Vector3:
        """From mission coordinates (relative to the arming position) to the vehicle's local NED."""
        assert self.origin_ned_m is not None, "mission coordinates have a meaning only after arming"
        return plus(self.origin_ned_m, 1.0, mission_ned_m)

    def mission_ned_m(self, local_ned_m: Vector3) -> Vector3:
        """From the vehicle's local NED to mission coordinates; the same before the origin is known."""
        return minus(local_ned_m, self.origin_ned_m or ZERO)


FlightT = TypeVar("FlightT", bound=FlightContext)


class Handler(Generic[FlightT]):
    """What is done in a state; one is made each time the state is entered."""

    finished = False  # nothing is left to send
    is_active = True  # as the companion's own HEARTBEAT has it
    has_floor = True  # the fence's floor counts, and not only the ground
    _target: Target | None = None

    def __init__(self, flight: FlightT, now_us: int) -> None:
        """Begun now."""

    def target(self, flight: FlightT, now_us: int) -> Target | None:
        """The setpoint for now, which in most states does not move; None while none must be sent."""
        return self._target

    def step(self, flight: FlightT, inputs: Inputs, now_us: int) -> Transition | None:
        """Do what is due; a transition when the state is over."""
        return None


def as_text(vector: Vector3) -> str:
    """For people, two decimals and no negative zero."""
    return "[" + ", ".join(f"{value:z.2f}" for value in vector) + "]"
