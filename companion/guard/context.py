"""What the guard's parts share: a flight's context, and whose vehicle it was before."""

import math
from dataclasses import dataclass, field

from companion.flight.context import FlightContext, Transition
from companion.guard.config import GuardConfig
from companion.guard.states import Trigger
from companion.messages import Asked, Sticks
from companion.motion.settling import Lasting


@dataclass(slots=True)
class GuardContext(FlightContext):
    """Changed by the guard's parts within a step."""

    config: GuardConfig = field(kw_only=True)
    # No setpoint but the guard's reaches the vehicle while it holds; so it is where all that is sent passes the guard.
    keeps_others_out: bool = field(kw_only=True)
    after_recovery: Transition = field(default=Transition(Trigger.SETTLED))
    previous_mode: int | None = None
    is_to_hold: bool = False  # is given back to hold whatever is configured
    others_stream: Lasting = field(default_factory=Lasting)  # by the mode, which is not the guard's
    program_elsewhere: bool = False  # since it was armed, some program sent setpoints on a link of its own
    was_met: bool = False  # since the guard began, and found fit to be guarded
    has_stood: bool = False  # on the ground, or disarmed, since the guard began
    awaits_choice: bool = False  # a program's setpoints are kept out until somebody chooses a mode
    left_alone: int = 0  # hits told, and left to the program that flies
    others_setpoint_us: float = -math.inf  # when one was last seen on its way
    asked: Asked = field(default=Asked())  # where it leads
    sticks: Sticks | None = None  # before the hit
    sticks_now: Sticks | None = None
    sticks_us: float = -math.inf  # when these were heard
    sinks_m_s: float = 0.0  # as its position control is asked for
    sinks_us: int | None = None  # when that was heard

    def note_touchdown(self) -> None:
        """The ground is here: heights count from it."""
        FlightContext.note_touchdown(self)
        latest, origin = self.vehicle.history.latest, self.origin_ned_m
        if latest is not None and origin is not None:
            self.origin_ned_m = (origin[0], origin[1], latest.position_ned_m[2])
