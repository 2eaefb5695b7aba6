"""What the guard's parts share: a flight's context, and whose vehicle it was before."""

import math
from dataclasses import dataclass, field

from companion.autopilot.known import defaults
from companion.flight.context import FlightContext, Transition
from companion.guard.config import GuardConfig
from companion.guard.states import Trigger
from companion.messages import Asked, Sticks
from companion.motion.vector import ZERO, minus, plus

# Setpoints are lost when there is none for so long.
LONGEST_BETWEEN_S = defaults.LOSS_US * 1e-6


@dataclass(slots=True)
class GuardContext(FlightContext):
    """Changed by the guard's parts within a step.

    `keeps_others_out`: no setpoint but the guard's reaches the vehicle while it holds; so it is where all that is sent
    passes through the guard. `is_to_hold`: the vehicle is given back to AUTO.LOITER whatever is configured.
    """

    config: GuardConfig = field(kw_only=True)
    keeps_others_out: bool = field(kw_only=True)
    after_recovery: Transition = field(default=Transition(Trigger.SETTLED))
    previous_mode: int | None = None
    is_to_hold: bool = False
    program_elsewhere: bool = False  # since it was armed, some program sent setpoints on a link of its own
    was_met: bool = False  # since the guard began, and found fit to be guarded
    has_stood: bool = False  # on the ground, or disarmed, since the guard began
    awaits_choice: bool = False  # a program's setpoints are kept out until somebody chooses a mode
    left_alone: int = 0  # hits told, and left to the program that flies
    others_setpoint_us: int | None = None  # when one was last seen on its way
    asked: Asked | None = None  # where it leads
    sticks: Sticks | None = None  # before the hit
    sticks_now: Sticks | None = None
    sticks_us: int | None = None  # when these were heard
    sinks_m_s: float = 0.0  # as its position control is asked for
    sinks_us: int | None = None  # when that was heard

    def hear_setpoint(self, asked: Asked, now_us: int) -> None:
        """A program's is on its way. A place without a velocity moves as it has moved since the one before."""
        before, before_us = self.asked, self.others_setpoint_us
        self.asked, self.others_setpoint_us = asked, now_us
        if before is None or before.place_ned_m is None or asked.place_ned_m is None or before_us is None:
            return
        since_s = (now_us - before_us) * 1e-6
        if asked.velocity_ned_m_s is None and 0.0 < since_s < LONGEST_BETWEEN_S:
            velocity = plus(ZERO, 1.0 / since_s, minus(asked.place_ned_m, before.place_ned_m))
            # What goes faster than a vehicle is the next place, and no motion.
            if math.hypot(*velocity) <= self.mission.limits.max_speed_m_s:
                self.asked = Asked(asked.place_ned_m, velocity)

    def await_choice(self, why: str, now_us: int) -> None:
        """Keep a program's setpoints out until somebody chooses a mode."""
        if not self.awaits_choice:
            self.awaits_choice = True
            self.report(now_us, "not_back", f"{why}: a program's setpoints are kept out until somebody chooses a mode")

    def note_touchdown(self) -> None:
        """The ground is here: heights count from it."""
        FlightContext.note_touchdown(self)
        latest, origin = self.vehicle.history.latest, self.origin_ned_m
        if latest is not None and origin is not None:
            self.origin_ned_m = (origin[0], origin[1], latest.position_ned_m[2])
