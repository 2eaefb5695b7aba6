"""State landing: PX4's own land mode, until the vehicle has disarmed itself; and out of it again after a hit."""

from companion.flight.context import Activity, FlightContext, Inputs, Move, Target
from companion.flight.states import Trigger
from companion.messages import SetMode
from companion.px4_mode import AUTO_LAND, OFFBOARD

# From 12 m at PX4's MPC_LAND_SPEED of 0.7 m/s it takes under 30 s with detection and disarming; this allows for
# the slowest speed it can be set to (0.6 m/s) from 60 m.
LANDING_TIMEOUT_US = 120_000_000


class Land:
    """Ask for the mode, keep the setpoints going until the vehicle has taken it, then wait."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        self._started_us = now_us
        self._target = flight.target
        self._landing = False
        flight.is_landing = True
        flight.command_client.begin(SetMode(AUTO_LAND))

    def target(self, now_us: int) -> Target | None:
        return None if self._landing else self._target

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Move | None:
        if flight.vehicle.armed is False:
            return Move(Trigger.DISARMED)
        if not self._landing:
            outcome = flight.command_outcome(inputs, flight.vehicle.custom_mode == AUTO_LAND, now_us)
            if outcome is None:
                return None
            if not outcome.succeeded:
                return Move(Trigger.INTERRUPTED, f"no landing: {outcome.text}", hand_over=True)
            self._landing = True
            flight.expected_mode = AUTO_LAND
            flight.tell(now_us, "landing", "landing here")
        if now_us - self._started_us > LANDING_TIMEOUT_US:
            seconds = LANDING_TIMEOUT_US // 1_000_000
            return Move(Trigger.INTERRUPTED, f"not disarmed {seconds} s after the order to land")
        return None


# Two setpoints ahead of the mode that needs them: PX4 takes OFFBOARD once it has heard one.
LEAD_US = 40_000


class TakeBack:
    """A recovery out of the land mode: its setpoints first, then OFFBOARD, in which alone they are flown.

    A vehicle that does not take the mode goes on landing by itself, and is left to it.
    """

    def __init__(self, flight: FlightContext, recovery: Activity, now_us: int) -> None:
        self._recovery = recovery
        self._is_taken = False
        # Of a second hit the first one's request may be on its way.
        self._is_asked = flight.command_client.requested_mode == OFFBOARD
        self._ask_us = now_us + (0 if self._is_asked else LEAD_US)
        if not self._is_asked:
            flight.command_client.cancel()

    def target(self, now_us: int) -> Target | None:
        return self._recovery.target(now_us)

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Move | None:
        if not self._is_taken and now_us >= self._ask_us:
            if not self._is_asked:
                self._is_asked = True
                flight.command_client.begin(SetMode(OFFBOARD))
            outcome = flight.command_outcome(inputs, flight.vehicle.custom_mode == OFFBOARD, now_us)
            if outcome is not None and not outcome.succeeded:
                return Move(Trigger.INTERRUPTED, f"no recovery from a hit in the landing: {outcome.text}")
            if outcome is not None:
                self._is_taken, flight.expected_mode = True, OFFBOARD
        return self._recovery.step(flight, inputs, now_us)
