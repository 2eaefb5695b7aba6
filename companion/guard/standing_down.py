"""State stood down: whoever took over has the vehicle until it is disarmed or somebody enables the guard again."""

from companion.flight.context import Target
from companion.guard.context import GuardContext, GuardInputs, Move
from companion.guard.states import Trigger
from companion.messages import SetMode
from companion.px4_mode import OFFBOARD, POSCTL

# PX4 answers in 10 ms; when it does not take the mode its own action for lost setpoints is the next best.
HAND_OVER_US = 500_000


class StandDown:
    """A pilot who moved the sticks is given the position mode, as PX4's own stick override does.

    OFFBOARD would go on without a word of the pilot's otherwise. Setpoints go on until the mode is seen.
    """

    def __init__(self, guard: GuardContext, for_sticks: bool, now_us: int) -> None:
        flight = guard.flight
        self._until_us = now_us + HAND_OVER_US
        self._target: Target | None = None
        if for_sticks and flight.vehicle.custom_mode == OFFBOARD and flight.target is not None:
            self._target = flight.target.at_rest()
            flight.command_client.begin(SetMode(POSCTL))

    @property
    def hands_over(self) -> bool:
        """Whether the pilot does not have the vehicle yet."""
        return self._target is not None

    def target(self, now_us: int) -> Target | None:
        return self._target

    def step(self, guard: GuardContext, inputs: GuardInputs, now_us: int) -> Move | None:
        flight = guard.flight
        if self._target is not None:
            is_seen = flight.vehicle.custom_mode != OFFBOARD
            outcome = flight.command_outcome(inputs.flight, is_seen, now_us)
            if outcome is not None or now_us > self._until_us:
                self._target = None
                flight.command_client.cancel()
        return Move(Trigger.ENABLED, "enabled again") if inputs.is_enabled else None
