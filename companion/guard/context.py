"""What the guard's parts share: a flight's context, and whose vehicle it was before."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from companion.flight.context import FlightContext, Inputs, Target
from companion.guard.config import GuardConfig
from companion.guard.states import Trigger
from companion.messages import GlobalPosition, PositionTarget, Sticks, Vector3


@dataclass(frozen=True, slots=True)
class Move:
    """A trigger with its story, "" where the state's own events tell it."""

    trigger: Trigger
    text: str = ""


@dataclass(frozen=True, slots=True)
class GuardInputs:
    """What one step brings: as a flight's inputs, and what only a guard looks at."""

    flight: Inputs = field(default_factory=Inputs)
    echoes: Sequence[PositionTarget] = ()
    sticks: Sequence[Sticks] = ()
    is_enabled: bool = False  # by a person, after it stood down


@dataclass(slots=True)
class GuardContext:
    """Changed by the guard's parts within a step.

    `keeps_others_out`: no setpoint but the guard's reaches the vehicle while it holds; so it is where all that is sent
    passes through the guard. `then_hold` says why the vehicle is given back to AUTO.LOITER whatever is configured.
    """

    config: GuardConfig
    flight: FlightContext
    keeps_others_out: bool
    previous_mode: int | None = None
    then_hold: str = ""
    program_elsewhere: bool = False  # since it was armed, some program sent setpoints on a link of its own
    hits: int = 0  # since it was armed
    left_alone: int = 0  # hits told, and left to the program that flies
    others_setpoint_us: int | None = None  # when one was last seen on its way
    sticks: Sticks | None = None
    global_position: GlobalPosition | None = None
    # When, and to where; None for a lean alone.
    sent_ned_m: deque[tuple[int, Vector3 | None]] = field(default_factory=lambda: deque(maxlen=64))


class Activity(Protocol):
    """What the guard does in a state; made anew each time the state is entered."""

    def step(self, guard: GuardContext, inputs: GuardInputs, now_us: int) -> Move | None:
        """Do what is due now; a Move when the state is over."""
        ...

    def target(self, now_us: int) -> Target | None:
        """The setpoint for now; None while none must be sent."""
        ...
