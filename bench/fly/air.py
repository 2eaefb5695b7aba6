"""Between the companion and the simulated vehicle: the connection and the clock of a real loop, in virtual time.

Whatever an injector does, it does here: to the bytes of either direction, to the clock, to the loop, to the vehicle.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from bench.fly.packets import ARM, COMMAND, SET_MODE, SETPOINT, custom_mode, decoded, outside
from bench.fly.station import GroundStation
from companion.companion import Companion
from companion.mavlink.packet import message_id_of
from companion.shell.connections.connection import MOST_DATAGRAMS
from companion.shell.connections.peer import LinkCounts
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.simulation.lockstep import EPOCH_US
from sim_vehicle.bench.faults import FaultRequest
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.vehicle import SimulatedVehicle

# A clock that is read goes on.
_READING_US = 4
# A ground station's own rates; sticks come at 10 Hz or more.
_STICKS_EVERY, _BEAT_EVERY = 20, 250
# As its packets say it.
POSCTL = 3 << 16
COMPLETED, HANDED_OVER, FAILED, KILLED = "completed", "aborted", "failed", "killed"
ENDS = {
    COMPLETED: "landed",
    HANDED_OVER: "handed over",
    FAILED: "fault told",
    KILLED: "landed by PX4",
    "hung": "not over in 60 s",
}


@dataclass(frozen=True, slots=True)
class When:
    """From some time after the companion was first in a state, and for how long."""

    state: str
    after_s: float = 0.0
    for_s: float = math.inf

    def is_on(self, air: Air, at_s: float | None = None) -> bool:
        """Now, or whether it was on then, by the vehicle's clock."""
        since_s = air.since.get(self.state)
        return (
            since_s is not None and 0.0 <= (air.now_s if at_s is None else at_s) - since_s - self.after_s < self.for_s
        )

    def ended_s(self, air: Air) -> float:
        """When it ends; of what has not begun never."""
        return air.since.get(self.state, math.inf) + self.after_s + self.for_s

    @classmethod
    def flying(cls, chance: random.Random, for_s: float = math.inf) -> When:
        """In the cruise towards the wall, or at the hit: at a random instant of the first 1.5 s of the item."""
        return cls("mission", chance.uniform(0.0, 1.5), for_s)

    @classmethod
    def recovering(cls, chance: random.Random) -> When:
        """At a random instant of the first 0.6 s after the hit."""
        return cls("recovering", chance.uniform(0.0, 0.6))


Act = Callable[["Air", list[bytes]], Sequence[bytes]]
"""What somebody makes of the packets on their way."""


@dataclass
class Injector:
    """What a fault does while it is time; what is not given it leaves alone."""

    when: When = When("never")
    once: Callable[[Air], None] | None = None  # when it begins
    to_companion: Act = lambda air, frames: frames
    to_vehicle: Act = lambda air, frames: frames
    note: Callable[[list[bytes]], None] = lambda frames: None  # sees all that the vehicle says from the beginning on
    ahead_s: float = 0.0  # of the clock that the companion reads
    has_pilot: bool = False


class Killed(BaseException):
    """SIGKILL: nothing of the program goes on."""


class Hung(BaseException):
    """The flight has taken longer than any should."""


@dataclass
class Air:
    """One flight's wire, clock and vehicle."""

    vehicle: SimulatedVehicle
    companion: Companion
    interrupts: Interrupts
    injector: Injector
    chance: random.Random
    limit_s: float
    at_first_item: Callable[[], None] | None = None
    since: dict[str, float] = field(default_factory=dict)
    """When the companion was first in a state; seconds of the vehicle's clock."""
    stall_s: float = 0.0  # how long the process gets no time, from now on
    outside: list[str] = field(default_factory=list)  # setpoints outside the envelope
    pilot_at_s: float | None = None  # when a pilot has taken position mode
    is_told: bool = False  # whether the companion has been handed a packet that says so
    after_told: int = 0  # setpoints and commands for mode or arming that it sent afterwards
    has_left_offboard: bool = False
    """Whether somebody else has flown since the first item: PX4's failsafe, its landing, a pilot."""
    has_pilot: bool = False  # seen in his mode since he has taken over
    is_overruled: bool = False  # whether the vehicle has left the pilot's mode
    counts: LinkCounts = field(default_factory=LinkCounts)
    _to_vehicle: list[bytes] = field(default_factory=list)
    _waiting: list[bytes] = field(default_factory=list)
    _station: GroundStation | None = None
    _readings: int = 0
    intervals: int = 0  # of the vehicle's, that have passed

    @property
    def now_s(self) -> float:
        """Of the vehicle, since it was switched on."""
        return self.vehicle.time_boot_us * 1e-6

    @property
    def state(self) -> str:
        """The companion's."""
        return self.companion.core.state.value

    # --- the clock and the connection of the loop

    def now_us(self) -> int:
        self._readings += 1
        now_us = EPOCH_US + self.vehicle.time_boot_us + _READING_US * self._readings
        return now_us + round(self.injector.ahead_s * 1e6) if self.injector.when.is_on(self) else now_us

    def sleep(self, duration_s: float) -> None:
        until_s = self.now_s + duration_s
        while self.now_s < until_s:
            self._waiting += self.passed()

    def receive(self, timeout_s: float) -> bytes:
        """A wait lets one interval pass, or a stall's many."""
        if not self._waiting and timeout_s > 0.0:
            self._waiting = self.passed()
            until_s, self.stall_s = self.now_s + self.stall_s, 0.0
            while self.now_s < until_s:
                self._waiting += self.passed()
        frames, self._waiting = self._waiting, []
        # A socket that is full drops what is new.
        return self._hand_over(frames[:MOST_DATAGRAMS])

    def way(self, frame: bytes) -> None:
        """Not on virtual time: whoever dies here leaves no word."""

    def news(self) -> str | None:
        return None

    def close(self) -> None:
        """There is nothing to close."""

    def send(self, frame: bytes) -> None:
        wrong = outside(self.companion.core, frame)
        if wrong is not None:
            self.outside.append(f"{wrong} at {self.now_s:.2f} s")
        if self.is_told and _takes_control(frame):
            self.after_told += 1
        self._to_vehicle.append(frame)

    def _hand_over(self, frames: Sequence[bytes]) -> bytes:
        if self.pilot_at_s is not None and not self.is_told:
            self.is_told = any(custom_mode(frame) == POSCTL for frame in frames if len(frame) > 12)
        return b"".join(frames)

    # --- the vehicle's side

    def passed(self) -> list[bytes]:
        """One interval of the vehicle; what reaches the companion of it."""
        if self.now_s > self.limit_s:
            raise Hung
        state = self.state
        if state == "mission" and self.at_first_item is not None:
            begin, self.at_first_item = self.at_first_item, None
            begin()
        self.has_left_offboard |= "mission" in self.since and self.vehicle.mode != "Offboard"
        self.since.setdefault(state, self.now_s)
        injector = self.injector
        if injector.once is not None and injector.when.is_on(self):
            do, injector.once = injector.once, None
            do(self)
        self._fly_sticks()
        frames, self._to_vehicle = self._to_vehicle, []
        said = self.vehicle.step(b"".join(injector.to_vehicle(self, frames) if injector.when.is_on(self) else frames))
        if self._station is not None:
            self._station.hear()
        if self.pilot_at_s is not None:
            self.is_overruled |= self.has_pilot and self.vehicle.mode != "Position"
            self.has_pilot |= self.vehicle.mode == "Position"
        injector.note(list(said))
        return list(injector.to_companion(self, list(said)) if injector.when.is_on(self) else said)

    def alone(self, seconds: float) -> None:
        """The vehicle goes on until it is disarmed, or for this long; nobody reads what it says."""
        until_s = self.now_s + seconds
        while self.now_s < until_s and self.vehicle.is_armed:
            self.vehicle.step(b"")
            self._fly_sticks()
            self.has_left_offboard |= self.vehicle.mode != "Offboard"

    # --- what injectors do

    def inject(self, request: FaultRequest, for_s: float | None = None) -> None:
        """A fault of the simulated vehicle's, from now on."""
        for fault in request.timed(self.now_s, for_s):
            self.vehicle.add_fault(fault)

    def kill(self) -> None:
        raise Killed

    def add_pilot(self) -> None:
        """A ground station with centred sticks, on a link of its own."""
        self._station = GroundStation(self.vehicle, LinkKind.GROUND)

    def take_over(self) -> None:
        """The pilot takes position mode."""
        assert self._station is not None, "there is a pilot from the beginning"
        self._station.set_mode("POSCTL")
        self.pilot_at_s = self.now_s

    def _fly_sticks(self) -> None:
        self.intervals += 1
        if self._station is None:
            return
        if self.intervals % _STICKS_EVERY == 0:
            self._station.move_sticks()
        if self.intervals % _BEAT_EVERY == 0:
            self._station.beat()


def _takes_control(frame: bytes) -> bool:
    number = message_id_of(frame)
    message = decoded(frame) if number == COMMAND else None
    return number == SETPOINT or (message is not None and message.command in (SET_MODE, ARM))


@dataclass(frozen=True, slots=True)
class Expected:
    """Beside what holds for every row: no loss of vehicle, log or authority, no setpoint outside the envelope."""

    outcomes: tuple[str, ...] = (COMPLETED,)
    """How a flight may end, by the report."""
    finds: bool = True
    """The hit is found."""
    has_wall: bool = True
    """Without one where nobody could see it: a hit that nobody answers shows PX4 and the airframe, not this program."""
    false_hits: int = 0
    """Recoveries from nothing that a flight may count as a collision."""
    blinds: bool = False
    """While it acts nothing shows a hit. What the wall does to a vehicle that meets it then shows PX4 and the airframe,
    not this program; the hit may be told when the sensor is back, as late as any other after its touch."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A row of the table. `inject` makes the fault anew for every flight, as its chance has it."""

    name: str
    injected: str
    inject: Callable[[random.Random], Injector]
    expected: Expected = Expected()
    expects: str = "lands"
    """The same in a word of `faults.yaml`."""
    from_the_start: bool = False
    """Whether the fault acts before the first item."""
