"""State aborted: give the vehicle to its own hold or land mode where that is wanted, then be silent."""

from companion.flight.authority import Holder, who_decided
from companion.flight.command_client import ACK_TIMEOUT_US, ATTEMPTS
from companion.flight.context import FlightContext, Inputs, Move, Target
from companion.messages import SetArmed, SetMode
from companion.px4_mode import AUTO_LAND, AUTO_LOITER, mode_name

# As long as it takes to ask for two modes in vain: nobody is to be kept in OFFBOARD by a hand-over that does not end.
LONGEST_US = 2 * ATTEMPTS * ACK_TIMEOUT_US


class LetGo:
    """Nothing more to do: the vehicle is not ours, or it was never taken."""

    finished = True

    def target(self, now_us: int) -> Target | None:
        return None

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Move | None:
        return None


class HandOver:
    """Disarm if the climb has not begun, then request the mode; setpoints go on until it is seen to hold.

    The mode is asked for straight after a report of the present one, so that whoever has taken the vehicle by then is
    seen first; whoever takes it later may have it, too. A vehicle that refuses to hold is asked to land. When the
    command client gives up (about 2.5 s without an answer), and after LONGEST_US at the latest, the setpoints stop all
    the same, and PX4's own loss-of-offboard action takes over.
    """

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        self._began_us = now_us
        self._is_asked = False
        self.finished = False
        self._target = None if flight.target is None else flight.target.at_rest()
        self._previous_mode = flight.expected_mode
        self._mode = AUTO_LAND if flight.mission.on_interrupt == "land" else AUTO_LOITER
        # Asked to arm and not yet seen armed: it has not climbed, and may arm any moment.
        self._disarming = flight.arming_requested and flight.armed_at_us is None
        flight.command_client.cancel()
        if self._disarming:
            flight.command_client.begin(SetArmed(False))

    def target(self, now_us: int) -> Target | None:
        return None if self.finished or now_us - self._began_us >= LONGEST_US else self._target

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Move | None:
        if self.finished:
            return None
        if self._taken_by_another(flight, now_us):
            self._finish(flight)
            return None
        if self._disarming:
            outcome = flight.command_outcome(inputs, False, now_us)
            if outcome is None:
                return None
            self._disarming = False
            inputs = Inputs()
        if not self._is_asked:
            if not flight.is_time_to_give_away(self._began_us, now_us):
                return None
            self._is_asked = True
            flight.command_client.begin(SetMode(self._mode))
        outcome = flight.command_outcome(inputs, flight.vehicle.custom_mode == self._mode, now_us)
        if outcome is None:
            return None
        if outcome.succeeded:
            flight.tell(now_us, "mode", f"handed over to {mode_name(self._mode)}")
        elif outcome.refused and self._mode == AUTO_LOITER:
            # PX4 holds only with a global position; without one (motion capture alone) it still lands.
            self._mode = AUTO_LAND
            flight.tell(now_us, "mode", "the vehicle does not hold: asking it to land")
            flight.command_client.begin(SetMode(self._mode))
            return None
        self._finish(flight)
        return None

    def _taken_by_another(self, flight: FlightContext, now_us: int) -> bool:
        report = flight.vehicle.mode
        if report is None or self._previous_mode is None:
            return False
        holder = who_decided(report, self._previous_mode, self._mode)
        if holder is Holder.COMPANION:
            return False
        flight.tell(now_us, "mode", f"{holder.value} took over in {mode_name(report.custom_mode)}")
        return True

    def _finish(self, flight: FlightContext) -> None:
        self.finished = True
        flight.command_client.cancel()
