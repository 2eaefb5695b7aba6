"""Lockstep with PX4's `simulator_mavlink`, without sockets and clocks: who may speak when.

STARTING  PX4 is connected and boots; samples go out at their own pace until its first answer
READY     the last sample is answered: the next may go out
AWAITING  a sample is out; time stands still on both sides until its answer comes
"""

from enum import Enum, auto

from sim_vehicle.errors import NotInLockstep
from sim_vehicle.hil.messages import MOTORS_STOPPED, ActuatorControls

# Real time between samples while PX4 boots: its modules start on threads of their own, and need some real
# time, not simulated time, before the first motor command.
STARTING_PERIOD_US = 4_000
# PX4 answers in 0.11 ms, and in 100 ms on a machine that is out of breath. Ten times that is a lost answer, or a PX4
# that was stopped. One more sample starts a PX4 that waits; a stopped one loses 4 ms a second.
ANSWER_TIMEOUT_US = 1_000_000
# Booting takes 2 s; a PX4 with no answer after ten times that has no motors to command.
STARTING_TIMEOUT_US = 20_000_000

# How the notice begins that PX4 is up, for programs that wait for it.
FIRST_ANSWER_WORDS = "PX4 answers"


class ExchangePhase(Enum):
    STARTING = auto()
    READY = auto()
    AWAITING = auto()


class Exchange:
    """With one PX4, from its connecting to its going. ``now_us`` is the machine's time, ``time_us`` the vehicle's and
    PX4's.
    """

    def __init__(self, now_us: int) -> None:
        """PX4 has connected: the vehicle that it gets must be a new one, with its clock at zero."""
        self.phase = ExchangePhase.STARTING
        self.notices: list[str] = []
        """Sentences for the person at the terminal; whoever shows them clears the list."""
        self.motor_fractions: tuple[float, ...] = MOTORS_STOPPED
        """PX4's last word, zero before its first."""
        self.overdue_answers = 0
        self._sent_time_us = 0
        self._sent_at_us = now_us - STARTING_PERIOD_US
        self._connected_at_us = now_us
        self._is_starting_explained = False

    def next_sample_at_us(self) -> int | None:
        """The machine's time from which the next sample may go out; None while an answer is awaited."""
        if self.phase is ExchangePhase.STARTING:
            return self._sent_at_us + STARTING_PERIOD_US
        return self._sent_at_us if self.phase is ExchangePhase.READY else None

    def sent(self, time_us: int, now_us: int) -> None:
        """Note that the sample of the vehicle's `time_us` was sent at the clock's `now_us`."""
        if self.phase is ExchangePhase.READY:
            self.phase = ExchangePhase.AWAITING
        self._sent_time_us = time_us
        self._sent_at_us = now_us

    def received(self, controls: ActuatorControls) -> None:
        """Take an answer. Raises NotInLockstep for a PX4 whose clock is not ours."""
        if not controls.is_lockstep or controls.time_us > self._sent_time_us:
            raise NotInLockstep(
                "PX4's clock does not follow the simulator's: build PX4 with lockstep, which `make px4_sitl` does."
            )
        self.motor_fractions = controls.motor_fractions if controls.armed else MOTORS_STOPPED
        if self.phase is ExchangePhase.STARTING:
            self.notices.append(f"{FIRST_ANSWER_WORDS}: lockstep from {1e-6 * controls.time_us:.3f} s on.")
            self.phase = ExchangePhase.READY
        elif self.phase is ExchangePhase.AWAITING and controls.time_us == self._sent_time_us:
            self.phase = ExchangePhase.READY
        # Any other is one to a sample before the last: sent while booting, or given up already.

    def look_at_clock(self, now_us: int) -> None:
        """Give up an answer that is overdue, and say when PX4 does not begin to answer at all."""
        if self.phase is ExchangePhase.AWAITING and now_us - self._sent_at_us >= ANSWER_TIMEOUT_US:
            self.phase = ExchangePhase.READY
            if self.overdue_answers == 0:
                self.notices.append(f"PX4 has not answered for {1e-6 * ANSWER_TIMEOUT_US:.0f} s; waiting for it.")
            self.overdue_answers += 1
        is_late = now_us - self._connected_at_us >= STARTING_TIMEOUT_US
        if self.phase is ExchangePhase.STARTING and is_late and not self._is_starting_explained:
            self._is_starting_explained = True
            self.notices.append(
                f"PX4 has sent no motor commands for {1e-6 * STARTING_TIMEOUT_US:.0f} s after connecting: "
                "look at its console, and whether its airframe is a multicopter with PWM_MAIN_FUNC1..4 set."
            )
