"""The pilot's hands: have the sticks been moved since the guard took over?

By PX4's default (COM_RC_OVERRIDE = 1) moved sticks end AUTO modes and not OFFBOARD, so the guard looks itself.
"""

from companion.messages import Sticks

# PX4's COM_RC_STICK_OV, 30 %.
MOVED = 0.3


def has_moved(before: Sticks, now: Sticks) -> bool:
    """A stick pushed to a new place counts; one let go does not: a pilot startled by a hit opens the hand.

    The throttle's middle is PX4's too; one that has no spring lies anywhere, and only its way from there counts.
    """
    for place, (was, deflection) in enumerate(zip(before.deflections, now.deflections, strict=True)):
        is_pushed = place == _THROTTLE or abs(deflection) > MOVED
        if is_pushed and abs(deflection - was) > MOVED:
            return True
    return False


_THROTTLE = 2
