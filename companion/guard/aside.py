"""Out of the way without a setpoint: hold at a place, by a command that a program's setpoints do not undo."""

import math

from companion.flight.commander import CommandOutcome
from companion.guard.context import GuardContext, GuardInputs
from companion.messages import GlobalPosition, Reposition, Vector3

# Mean radius: over the metre in question any earth is a ball.
EARTH_RADIUS_M = 6_371_000.0


class StepAside:
    """AUTO.LOITER alone would hold where the vehicle, going at the hit's speed, could have stopped: behind the wall."""

    def __init__(self, guard: GuardContext) -> None:
        flight, here = guard.flight, guard.global_position
        latest = flight.vehicle.history.latest()
        self.is_over = here is None or latest is None or not flight.collisions
        if here is not None and latest is not None and flight.collisions:
            goal = flight.collisions[-1].setpoint_ned_m
            flight.commander.begin(place_of(here, latest.position_ned_m, goal))

    def step(self, guard: GuardContext, inputs: GuardInputs, now_us: int) -> CommandOutcome | None:
        """Until the vehicle has answered, one way or the other."""
        outcome = guard.flight.command_outcome(inputs.flight, False, now_us)
        self.is_over = outcome is not None
        return outcome


def place_of(here: GlobalPosition, here_ned_m: Vector3, goal_ned_m: Vector3) -> Reposition:
    """The goal, a few metres from here, on the globe."""
    north, east, down = (g - h for g, h in zip(goal_ned_m, here_ned_m, strict=True))
    parallel_m = EARTH_RADIUS_M * math.cos(math.radians(here.latitude_deg))
    return Reposition(
        here.latitude_deg + math.degrees(north / EARTH_RADIUS_M),
        here.longitude_deg + math.degrees(east / parallel_m),
        here.altitude_m - down,
    )
