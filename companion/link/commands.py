"""Commands to the vehicle: one at a time, repeated until answered, given up in the end."""

from collections.abc import Sequence
from dataclasses import dataclass

from companion import messages
from companion.messages import CommandResult

# PX4 answers in 2 to 10 ms on UDP; a telemetry radio's round trip stays below half a second.
ACK_TIMEOUT_US = 500_000
# After ACCEPTED: two of PX4's one-second HEARTBEATs may be needed to see the effect, one of them lost.
CONFIRMATION_TIMEOUT_US = 2_500_000
# A temporary refusal (a check still failing) is worth asking about once a second, PX4's own rhythm of checks.
REFUSAL_PAUSE_US = 1_000_000
# Answers after which the effect is expected.
TAKEN_UP = (CommandResult.ACCEPTED, CommandResult.IN_PROGRESS)
# Five lost or refused in a row are no accident.
ATTEMPTS = 5


@dataclass(frozen=True, slots=True)
class CommandOutcome:
    """The end of a command. `text` names it and, after a failure, the vehicle's last answer.

    `refused`: it failed with a refusal, and not for lack of an answer.
    """

    succeeded: bool
    text: str
    refused: bool = False


@dataclass(slots=True)
class CommandClient:
    """Holds at most one command. `begin`, then `step` with what has arrived until it returns an outcome."""

    pending: messages.VehicleCommand | None = None
    attempts: int = 0  # how often it was sent
    _repeat_at_us: int = 0
    _last_result: CommandResult | None = None

    @property
    def requested_mode(self) -> int | None:
        """The requested mode that is not confirmed yet."""
        return None if self.pending is None else self.pending.custom_mode

    def begin(self, command: messages.VehicleCommand) -> None:
        """Take up a command, dropping any other; it goes out in the next `step`."""
        self.pending, self.attempts = command, 0
        self._repeat_at_us, self._last_result = 0, None

    def cancel(self) -> None:
        self.pending = None

    def step(
        self, acks: Sequence[messages.CommandAck], seen: bool, now_us: int, may_send: bool = True
    ) -> tuple[messages.SendCommand | None, CommandOutcome | None]:
        """`seen`: the command's effect shows in the vehicle's own messages.

        Returns what to send now, and the outcome once there is one. An attempt that `may_send` forbids counts as sent
        and lost.
        """
        command = self.pending
        if command is None:
            return None, None
        # PX4 may accept a mode and reject it in a second answer: modes and arming count when they are seen. Disarming
        # does not: before the next HEARTBEAT a vehicle that has just armed still looks disarmed.
        is_confirmed_by_state = command.custom_mode is not None or command == messages.ARM
        if is_confirmed_by_state and seen:
            return self._end(command, True, "confirmed")
        for ack in acks:
            if ack.command == command.command_id and self.attempts > 0:
                wait_us = CONFIRMATION_TIMEOUT_US if ack.result in TAKEN_UP else REFUSAL_PAUSE_US
                self._last_result, self._repeat_at_us = ack.result, now_us + wait_us
                if ack.result is CommandResult.ACCEPTED and not is_confirmed_by_state:
                    return self._end(command, True, "accepted")
                if _is_final(command, ack.result):
                    return self._end(command, False, f"the vehicle answered {ack.result.name}")
        if now_us < self._repeat_at_us:
            return None, None
        if self.attempts >= ATTEMPTS:
            return self._end(command, False, self._why_given_up())
        attempt, self._repeat_at_us = self.attempts, now_us + ACK_TIMEOUT_US
        self.attempts += 1
        return messages.SendCommand(command, attempt) if may_send else None, None

    def _end(self, command: messages.VehicleCommand, succeeded: bool, text: str) -> tuple[None, CommandOutcome]:
        self.pending = None
        refused = not succeeded and self._last_result not in (None, *TAKEN_UP)
        return None, CommandOutcome(succeeded, f"{command.text}: {text}", refused)

    def _why_given_up(self) -> str:
        if self._last_result is None:
            return f"no answer to {self.attempts} attempts"
        if self._last_result in TAKEN_UP:
            return f"answered {self._last_result.name} but never took effect, {self.attempts} attempts"
        return f"the vehicle answered {self._last_result.name} to {self.attempts} attempts"


def _is_final(command: messages.VehicleCommand, result: CommandResult) -> bool:
    """Whether repeating is useless. A refused disarm is final: the vehicle flies."""
    is_disarm = command in (messages.DISARM, messages.DISARM_BY_FORCE)
    is_flying = is_disarm and result is CommandResult.TEMPORARILY_REJECTED
    return is_flying or result in (CommandResult.DENIED, CommandResult.UNSUPPORTED, CommandResult.FAILED)
