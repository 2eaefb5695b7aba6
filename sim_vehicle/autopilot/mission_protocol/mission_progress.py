"""MISSION_CURRENT and MISSION_ITEM_REACHED on one link: at every change, and again for whoever missed it.

Source: PX4's MavlinkMissionManager::send and update_mission_state.
"""

from sim_vehicle.autopilot.mission_protocol.mission_messages import MissionAnswer, SendCurrent, SendReached
from sim_vehicle.autopilot.mission_protocol.mission_store import MissionStore

# MISSION_CURRENT is repeated once a second, and MISSION_ITEM_REACHED with it as often as this.
CURRENT_PERIOD_US = 1_000_000
REACHED_REPEATS = 10
_MODE_ACTIVE, _MODE_SUSPENDED = 1, 2
_NO_MISSION = 0xFFFF


class ProgressReport:
    """The store and the time in, messages out."""

    def __init__(self, store: MissionStore) -> None:
        self._store = store
        self._sent_us = 0
        self._current = store.current
        self._reached = store.progress.reached
        self._repeats = 0
        self._state = 0

    def update(self, now_us: int) -> list[MissionAnswer]:
        """What is due now, nearly always nothing."""
        store, progress = self._store, self._store.progress
        is_due = now_us - self._sent_us >= CURRENT_PERIOD_US
        if not is_due and store.current == self._current and progress.reached == self._reached:
            return []
        answers: list[MissionAnswer] = []
        if is_due or store.current != self._current:
            self._sent_us, self._current = now_us, store.current
            answers.append(self._current_message())
        if progress.reached != self._reached:
            self._reached, self._repeats = progress.reached, 0
        elif not is_due or self._repeats == REACHED_REPEATS:
            return answers
        else:
            self._repeats += 1
        if progress.reached >= 0 and store.mission.items:
            answers.append(SendReached(progress.reached))
        return answers

    def _current_message(self) -> SendCurrent:
        store = self._store
        count = len(store.mission.items)
        self._state = store.progress.state(count, store.current) or self._state
        mode = _MODE_ACTIVE if store.progress.is_flown else _MODE_SUSPENDED
        return SendCurrent(store.current, count or _NO_MISSION, self._state, mode)
