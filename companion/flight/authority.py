"""Who decided the vehicle's present mode: the companion, a failsafe, or the pilot."""

from enum import Enum

from companion.link.vehicle import ModeReport


class Holder(Enum):
    COMPANION = "companion"
    FAILSAFE = "failsafe"
    PILOT = "pilot"


def who_decided(report: ModeReport, expected_mode: int, requested_mode: int | None) -> Holder:
    """Tell the three apart from one report of the mode.

    `expected_mode` is the one the companion has been seen to hold; `requested_mode` one it has asked for and not
    yet seen. In a failsafe PX4 keeps the user's intended mode (CURRENT_MODE) and reports MAV_STATE_CRITICAL
    (HEARTBEAT); a pilot's change moves the intended mode too.
    """
    if report.custom_mode in (expected_mode, requested_mode):
        return Holder.COMPANION
    still_intended = report.intended_custom_mode is not None and report.intended_custom_mode in (
        expected_mode,
        requested_mode,
    )
    return Holder.FAILSAFE if report.failsafe or still_intended else Holder.PILOT
