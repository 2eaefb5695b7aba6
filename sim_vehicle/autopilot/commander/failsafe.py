"""Which failsafe acts: delays, precedence, takeover by the pilot and fall-backs, as PX4's framework has them.

Source: PX4's commander/failsafe/framework.cpp. What sets one off stands in `failsafe_table`.
"""

from dataclasses import dataclass

from sim_vehicle.autopilot.commander.failsafe_table import (
    MODE_OF,
    Action,
    Clears,
    FailsafeSituation,
    FailsafeTrigger,
    Response,
    Takeover,
    mode_fallback,
    responses_now,
)
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.parameters.store import Parameters

# Below this COM_FAIL_ACT_T there is no delay, and then sticks alone do not take over either.
_NO_DELAY_S = 0.1

# If its mode cannot run, an action gives way to the next; the last needs nothing.
_LADDER = tuple(MODE_OF)
# Modes flown by sticks need no taking over.
_CAN_BE_TAKEN_OVER = (Action.HOLD, Action.RETURN, Action.LAND, Action.DESCEND)
# A vehicle that lands or returns already does not begin a return.
_ON_THE_WAY_DOWN = (Mode.LAND, Mode.RETURN)
_NOT_DELAYED = (Action.NONE, Action.WARN, Action.HOLD)


@dataclass(slots=True)
class _Active:
    """An action that was set off and has not ended."""

    action: Action
    clears: Clears
    takeover: Takeover
    failing: bool = True


@dataclass(frozen=True, slots=True)
class Decision:
    """What the commander is to do."""

    action: Action
    intended: Mode
    """The mode that is meant: POSCTL after sticks took over."""
    says: tuple[str, ...] = ()

    @property
    def flown(self) -> Mode:
        """The mode that flies."""
        return MODE_OF.get(self.action, self.intended)


class Failsafe:
    """Pure: situation, parameters and time in, decision out; call it in every cycle of the commander."""

    def __init__(self) -> None:
        self.action = Action.NONE
        self.took_over = False
        """The pilot has taken over from a failsafe that would still act."""
        self._active: dict[FailsafeTrigger, _Active] = {}
        self._last_us: int | None = None
        self._armed = False
        self._intended: Mode | None = None
        self._delay_us = 0
        self._announce = False

    @property
    def acts(self) -> bool:
        """Whether something else flies than what is meant."""
        return self.action > Action.WARN

    def update(self, now_us: int, now: FailsafeSituation, parameters: Parameters) -> Decision:
        """Judge the situation."""
        elapsed_us = 0 if self._last_us is None else now_us - self._last_us
        self._last_us = now_us
        if now.armed is not self._armed:
            self._forget_kept()
            self.took_over, self._armed = False, now.armed
        changed = now.mode_requested or (self._intended is not None and now.intended is not self._intended)
        if changed or self.took_over:
            self._forget_kept()
        self._delay_us = max(0, self._delay_us - elapsed_us)
        self._check(now, parameters)
        if self.action > Action.HOLD or Mode.LOITER in now.cannot_run or self.took_over:
            self._delay_us = 0
        decision, delayed, took_over = self._select(now, parameters, changed)
        says = self._announcement(decision.action, delayed)
        self.action, self.took_over, self._intended = decision.action, took_over, decision.intended
        return Decision(decision.action, decision.intended, says)

    def _announcement(self, action: Action, delayed: Action) -> tuple[str, ...]:
        tells = action > self.action or (action is not Action.NONE and self._announce)
        self._announce = False
        if not tells or action is Action.WARN:
            return ()
        if action is Action.HOLD and delayed is not Action.NONE:
            return (f"Failsafe activated: entering Hold for {round(1e-6 * self._delay_us)} seconds",)
        return ("Failsafe activated",)

    # --- which actions are in force ------------------------------------------------------------------------

    def _check(self, now: FailsafeSituation, parameters: Parameters) -> None:
        found = dict(responses_now(now, parameters))
        fallback = mode_fallback(now, parameters, now.intended)
        if fallback is not Action.NONE:
            found[FailsafeTrigger.MODE_CANNOT_RUN] = Response(fallback, takeover=Takeover.ALWAYS)
        for trigger, response in found.items():
            self._set_off(trigger, response, parameters)
        for trigger, active in list(self._active.items()):
            active.failing = trigger in found
            if not active.failing and active.clears is Clears.AT_ONCE:
                del self._active[trigger]

    def _set_off(self, trigger: FailsafeTrigger, response: Response, parameters: Parameters) -> None:
        active = self._active.get(trigger)
        if active is not None:
            # The action may change meanwhile; how it ends and who may end it stays.
            active.action = response.action
            return
        takeover = response.takeover
        if takeover is Takeover.AFTER_DELAY:
            takeover = Takeover.BY_MODE_SWITCH
            if parameters["COM_FAIL_ACT_T"] > _NO_DELAY_S:
                takeover = Takeover.ALWAYS
                if response.action is not Action.WARN and self._delay_us == 0:
                    self._delay_us = int(1e6 * parameters["COM_FAIL_ACT_T"])
        self._active[trigger] = _Active(response.action, response.clears, takeover)
        self._announce = self._announce or response.action is Action.WARN
        if response.action >= Action.HOLD:
            self.took_over = False

    def _forget_kept(self) -> None:
        for trigger, active in list(self._active.items()):
            if not active.failing and active.clears is Clears.MODE_CHANGE_OR_DISARM:
                del self._active[trigger]

    # --- which of them flies -------------------------------------------------------------------------------

    def _select(self, now: FailsafeSituation, parameters: Parameters, changed: bool) -> tuple[Decision, Action, bool]:
        """The decision, the action that waits behind it, and whether the pilot has it."""
        if not now.armed or now.intended is Mode.TERMINATION:
            return Decision(Action.NONE, now.intended), Action.NONE, False
        action = max((active.action for active in self._active.values()), default=Action.NONE)
        takeover = max((active.takeover for active in self._active.values()), default=Takeover.ALWAYS)
        delayed, intended, took_over = Action.NONE, now.intended, False
        may_wait = takeover <= Takeover.BY_MODE_SWITCH and action not in _NOT_DELAYED
        if self._delay_us > 0 and not self.took_over and may_wait:
            delayed, action, takeover = action, Action.HOLD, Takeover.BY_MODE_SWITCH
        if action in _CAN_BE_TAKEN_OVER and self._takes_over(now, takeover, changed):
            if not self.took_over and now.sticks_moved:
                intended = Mode.POSCTL
            took_over, delayed = True, Action.NONE
            action = max(Action.WARN, mode_fallback(now, parameters, intended))
        action = _that_can_run(action, now)
        if Action.RETURN in (action, delayed) and intended in _ON_THE_WAY_DOWN and intended not in now.cannot_run:
            action, delayed = Action.WARN, Action.NONE
        return Decision(action, intended), delayed, took_over

    def _takes_over(self, now: FailsafeSituation, takeover: Takeover, changed: bool) -> bool:
        switched = changed and self.acts
        if takeover is Takeover.ALWAYS:
            return self.took_over or switched or now.sticks_moved
        return takeover is Takeover.BY_MODE_SWITCH and (self.took_over or switched)


def _that_can_run(action: Action, now: FailsafeSituation) -> Action:
    if action not in _LADDER:
        return action
    return next(step for step in _LADDER[_LADDER.index(action) :] if MODE_OF[step] not in now.cannot_run)
