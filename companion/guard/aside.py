"""Out of the way without a setpoint: hold at a place, by a command that a program's setpoints do not undo."""

import math

from companion.flight.context import Inputs
from companion.guard.context import GuardContext, GuardInputs
from companion.messages import GlobalPosition, Reposition, Vector3

# Mean radius: over the metre in question any earth is a ball.
EARTH_RADIUS_M = 6_371_000.0


# PX4's AUTO modes begin with the acceleration that the estimator shows at that moment (FlightTaskAuto::activate) and
# change it by MPC_JERK_AUTO = 4 m/s^3. Asked for at the hit itself, a real PX4 began with -64 m/s^2 and flew off
# backwards at its greatest speed; asked for 0.3 s later, the program's setpoints had pushed it into the wall again.
# So as soon as the contact is over: nothing pushes for 40 ms, ten samples of a fast IMU stream.
CONTACT_OVER_US = 40_000
# A contact that never ends is no reason to wait for ever.
LONGEST_WAIT_US = 300_000


class StepAside:
    """AUTO.LOITER alone would hold where the vehicle, going at the hit's speed, could have stopped: behind the wall."""

    def __init__(self, now_us: int) -> None:
        self._due_us = now_us + LONGEST_WAIT_US
        self._is_begun = self.is_over = False

    def step(self, guard: GuardContext, inputs: GuardInputs, now_us: int) -> None:
        """Until the vehicle has answered, one way or the other; over at once where nothing is known of the place."""
        flight, here = guard.flight, guard.global_position
        latest = flight.vehicle.history.latest()
        if now_us < self._due_us and not self._is_begun and not _is_free(guard):
            return
        if self._is_begun:
            self.is_over = flight.command_outcome(inputs.flight, False, now_us) is not None
        elif here is None or latest is None or not flight.collisions:
            self.is_over = True
        else:
            self._is_begun = True
            goal = flight.collisions[-1].setpoint_ned_m
            flight.command_client.begin(place_of(here, latest.position_ned_m, goal))
            flight.command_outcome(Inputs(), False, now_us)


def _is_free(guard: GuardContext) -> bool:
    flight = guard.flight
    latest = flight.vehicle.history.latest()
    if latest is None or not flight.collisions:
        return True
    return latest.time_boot_us - flight.collisions[-1].contact_ended_boot_us >= CONTACT_OVER_US


def place_of(here: GlobalPosition, here_ned_m: Vector3, goal_ned_m: Vector3) -> Reposition:
    """The goal, a few metres from here, on the globe."""
    north, east, down = (g - h for g, h in zip(goal_ned_m, here_ned_m, strict=True))
    parallel_m = EARTH_RADIUS_M * math.cos(math.radians(here.latitude_deg))
    return Reposition(
        here.latitude_deg + math.degrees(north / EARTH_RADIUS_M),
        here.longitude_deg + math.degrees(east / parallel_m),
        here.altitude_m - down,
    )
