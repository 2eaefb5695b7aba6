"""How far the mission is, told on a link.

Source: PX4's MavlinkMissionManager::send and update_mission_state.
"""

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.mavlink.encode import Message
from sim_vehicle.mavlink.services.service import Board, Channel, Service

# MISSION_CURRENT is repeated once a second, and MISSION_ITEM_REACHED with it as often as this.
CURRENT_PERIOD_US = 1_000_000
REACHED_REPEATS = 10
_MODE_ACTIVE, _MODE_SUSPENDED = 1, 2
_NO_MISSION = 0xFFFF


class MissionService(Service):
    """MISSION_CURRENT and MISSION_ITEM_REACHED come at every change, and again for whoever missed it."""

    def __init__(self, link: Channel, board: Board) -> None:
        self._link = link
        self._store = store = board.autopilot.missions
        self._sent_us = 0
        self._current, self._reached = store.current, store.progress.reached
        self._repeats = 0
        self._state = 0

    def update(self, now_us: int) -> None:
        """What is due now, nearly always nothing."""
        store, progress = self._store, self._store.progress
        is_due = now_us - self._sent_us >= CURRENT_PERIOD_US
        if not is_due and store.current == self._current and progress.reached == self._reached:
            return
        if is_due or store.current != self._current:
            self._sent_us, self._current = now_us, store.current
            self._link.send(self._current_message())
        if progress.reached != self._reached:
            self._reached, self._repeats = progress.reached, 0
        elif not is_due or self._repeats == REACHED_REPEATS:
            return
        else:
            self._repeats += 1
        if progress.reached >= 0 and store.mission:
            self._link.send(dialect.MAVLink_mission_item_reached_message(progress.reached))

    def _current_message(self) -> Message:
        store = self._store
        count = len(store.mission)
        self._state = store.progress.state(count, store.current) or self._state
        mode = _MODE_ACTIVE if store.progress.is_flown else _MODE_SUSPENDED
        return dialect.MAVLink_mission_current_message(store.current, count or _NO_MISSION, self._state, mode)
