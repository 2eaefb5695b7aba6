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


@dataclass(slots=True)
class Pending:
    """A command on its way: sent `attempts` times, to be sent again at `repeat_at_us`."""

    command: messages.VehicleCommand
    attempts: int = 0
    repeat_at_us: int = 0
    last_result: CommandResult | None = None


@dataclass(frozen=True, slots=True)
class CommandOutcome:
    """The end of a command. `text` names it and, after a failure, the vehicle's last answer.

    `refused`: it failed with a refusal, and not for lack of an answer.
    """

    succeeded: bool
    text: str
    refused: bool = False


def needs_confirmation(command: messages.VehicleCommand) -> bool:
    """PX4 may accept a mode and reject it in a second answer: modes and arming count when they are seen.

    Disarming does not: before the next HEARTBEAT a vehicle that has just armed still looks disarmed.
    """
    return command.custom_mode is not None or command == messages.ARM


def is_final(command: messages.VehicleCommand, result: CommandResult) -> bool:
    """Whether repeating is useless. A refused disarm is final: the vehicle flies."""
    if result in (CommandResult.DENIED, CommandResult.UNSUPPORTED, CommandResult.FAILED):
        return True
    is_disarm = command in (messages.DISARM, messages.DISARM_BY_FORCE)
    return is_disarm and result is CommandResult.TEMPORARILY_REJECTED


class CommandClient:
    """Holds at most one command. `begin`, then `step` with what has arrived until it returns an outcome."""

    def __init__(self) -> None:
        self.pending: Pending | None = None

    @property
    def requested_mode(self) -> int | None:
        """The requested mode that is not confirmed yet."""
        return None if self.pending is None else self.pending.command.custom_mode

    def begin(self, command: messages.VehicleCommand) -> None:
        """Take up a command, dropping any other; it goes out in the next `step`."""
        self.pending = Pending(command)

    def cancel(self) -> None:
        self.pending = None

    def step(
        self, acks: Sequence[messages.CommandAck], seen: bool, now_us: int, may_send: bool = True
    ) -> tuple[messages.SendCommand | None, CommandOutcome | None]:
        """`seen`: the command's effect shows in the vehicle's own messages.

        Returns what to send now, and the outcome once there is one. An attempt that `may_send` forbids counts as sent
        and lost.
        """
        pending = self.pending
        if pending is None:
            return None, None
        is_confirmed_by_state = needs_confirmation(pending.command)
        if is_confirmed_by_state and seen:
            return self._end(pending, True, "confirmed")
        for ack in acks:
            if ack.command == pending.command.command_id and pending.attempts > 0:
                wait_us = CONFIRMATION_TIMEOUT_US if ack.result in TAKEN_UP else REFUSAL_PAUSE_US
                pending.last_result, pending.repeat_at_us = ack.result, now_us + wait_us
                if ack.result is CommandResult.ACCEPTED and not is_confirmed_by_state:
                    return self._end(pending, True, "accepted")
                if is_final(pending.command, ack.result):
                    return self._end(pending, False, f"the vehicle answered {ack.result.name}")
        if now_us < pending.repeat_at_us:
            return None, None
        if pending.attempts >= ATTEMPTS:
            return self._end(pending, False, _why_given_up(pending))
        attempt, pending.repeat_at_us = pending.attempts, now_us + ACK_TIMEOUT_US
        pending.attempts += 1
        return messages.SendCommand(pending.command, attempt) if may_send else None, None

    def _end(self, pending: Pending, succeeded: bool, text: str) -> tuple[None, CommandOutcome]:
        self.pending = None
        refused = not succeeded and pending.last_result is not None and pending.last_result not in TAKEN_UP
        return None, CommandOutcome(succeeded, f"{pending.command.text}: {text}", refused)


def _why_given_up(pending: Pending) -> str:
    if pending.last_result is None:
        return f"no answer to {pending.attempts} attempts"
    if pending.last_result in TAKEN_UP:
        return f"answered {pending.last_result.name} but never took effect, {pending.attempts} attempts"
    return f"the vehicle answered {pending.last_result.name} to {pending.attempts} attempts"
