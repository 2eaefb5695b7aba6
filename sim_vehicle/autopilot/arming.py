"""Arming and disarming, by command and by itself.

Source: PX4's Commander::arm, Commander::disarm and Commander::handleAutoDisarm.
"""

from enum import StrEnum

from sim_vehicle.autopilot.messages import Result

# COM_SPOOLUP_TIME (1 s) + COM_DISARM_PRFLT (10 s): an armed vehicle on which nobody acts.
DISARM_WITHOUT_TAKEOFF_US = 11_000_000
# COM_DISARM_LAND: long enough that a bounce on landing does not stop the motors in the air.
DISARM_LANDED_US = 2_000_000


class Reason(StrEnum):
    """Who armed or disarmed, in PX4's words."""

    COMMAND = "external command"
    LANDING = "landing"
    INACTION = "auto preflight disarming"


class Arming:
    """Whether the motors may turn, since when, and what has happened since."""

    def __init__(self) -> None:
        self.armed = False
        self.armed_at_us = 0
        self.taken_off = False
        self._landed_since_us: int | None = None

    def arm(self, now_us: int, checks_pass: bool, forced: bool) -> Result:
        """ARM by command: refused while checks fail, unless forced; arming twice is accepted."""
        if self.armed:
            return Result.ACCEPTED
        if not checks_pass and not forced:
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
            self.taken_off = True
            self._landed_since_us = None
            return None
        if not self.taken_off:
            if now_us - self.armed_at_us < DISARM_WITHOUT_TAKEOFF_US:
                return None
            self.armed = False
            return Reason.INACTION
        if self._landed_since_us is None:
            self._landed_since_us = now_us
        if now_us - self._landed_since_us < DISARM_LANDED_US:
            return None
        self.armed = False
        return Reason.LANDING
