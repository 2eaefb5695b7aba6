"""Arming and disarming, by command and by itself.

Sources: PX4's Commander::arm, Commander::disarm and Commander::handleAutoDisarm.
"""

from enum import StrEnum

from sim_vehicle.autopilot.messages import Result
from sim_vehicle.parameters.store import Parameters


class Reason(StrEnum):
    """Who armed or disarmed, in PX4's words."""

    COMMAND = "external command"
    MISSION = "mission start"
    LANDING = "landing"
    INACTION = "auto preflight disarming"


class Arming:
    """Whether the motors may turn, since when, and what has happened since."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.armed = False
        self.armed_at_us = 0
        self.taken_off = False
        self.taken_off_at_us = 0
        self._landed_since_us: int | None = None

    def arm(self, now_us: int, checks_pass: bool) -> Result:
        """ARM by command: refused while checks fail; arming twice is accepted."""
        if self.armed:
            return Result.ACCEPTED
        if not checks_pass:
            return Result.TEMPORARILY_REJECTED
        self.armed = True
        self.armed_at_us = now_us
        self.taken_off = False
        self._landed_since_us = None
        return Result.ACCEPTED

    def disarm(self, landed: bool, forced: bool) -> Result:
        """DISARM by command: refused in the air unless forced; disarming twice is accepted."""
        if self.armed and not landed and not forced:
            return Result.TEMPORARILY_REJECTED
        self.armed = False
        return Result.ACCEPTED

    def disarm_by_itself(self, now_us: int, landed: bool) -> Reason | None:
        """Disarm after landing or after standing armed for too long; call at every step while armed."""
        if not landed:
            if not self.taken_off:
                self.taken_off, self.taken_off_at_us = True, now_us
            self._landed_since_us = None
            return None
        if self._landed_since_us is None:
            self._landed_since_us = now_us
        since_us, wait_s, more_s = self._landed_since_us, self._parameters["COM_DISARM_LAND"], 0.0
        if not self.taken_off:
            # PX4 counts both for an armed vehicle on which nobody acts; a time of 0 or less switches it off.
            since_us, wait_s = self.armed_at_us, self._parameters["COM_DISARM_PRFLT"]
            more_s = self._parameters["COM_SPOOLUP_TIME"]
        if wait_s <= 0 or (now_us - since_us) / 1e6 < wait_s + more_s:
            return None
        self.armed = False
        return Reason.LANDING if self.taken_off else Reason.INACTION
