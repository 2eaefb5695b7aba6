"""Detector `tracking`: a supervisor that takes a large error in following the path for a contact.

After R. Naldi et al., "Robust 'blind' navigation for a miniature ducted-fan aerial robot" (American Control Conference,
2013), as the paper tells it: a supervisor detects a collision by a threshold on the error of the path-following
controller. Here

    | p_setpoint(t) - p(t) | - its running mean   >= bound,

the mean being the lag that every vehicle flies behind its setpoint with. It needs no accelerometer at all, and sees a
hit only when the path has gone on without the vehicle: tenths of a second late; a hit on a vehicle that hovers only by
how far it was thrown.

Neither the article's text nor a program of its authors was at hand: which error they take (place, velocity, heading),
and its bound, were not checked. The error of the place, the running mean and the bound are this project's.
"""

import math
from dataclasses import dataclass

from bench.detectors.contact import Baseline, BaselineState, judge
from companion.messages import LocalPosition
from companion.motion.rotation import ned_to_body
from companion.motion.vector import ZERO
from companion.reflex.detector import Impact, Situation

# The lag follows the speed within a second; velocities before that belong to another part of the path.
MEAN_MEMORY_S = 1.0
# A setpoint that jumps further than this from one position to the next begins a new path.
JUMP_M = 0.5
# PX4 follows a setpoint that speeds up by 2 m/s^2 to 0.2 m; a good position is good to 0.01 m.
BOUND_M = 0.3


@dataclass(slots=True)
class TrackingState(BaselineState):
    """Adds the path's error; changed in place. `threshold_m_s2` stays 0: no force is looked at."""

    setpoint_ned_m: tuple[float, float, float] | None = None
    position_boot_us: int = 0
    mean_m: float = 0.0


class TrackingDetector(Baseline):
    """See the module's text."""

    name, state, looks_at = "tracking", TrackingState, LocalPosition

    def look(self, state: TrackingState, sample: LocalPosition, situation: Situation) -> Impact | None:
        asked, now_us = situation.setpoint_position_ned_m, sample.time_boot_us
        if asked is None:
            return judge(state, now_us, now_us, ZERO, 0.0, False, "no setpoint")
        last, state.setpoint_ned_m = state.setpoint_ned_m, asked
        p = sample.position_ned_m
        behind = (p[0] - asked[0], p[1] - asked[1], p[2] - asked[2])
        error_m = math.sqrt(behind[0] ** 2 + behind[1] ** 2 + behind[2] ** 2)
        elapsed_s = min(max(now_us - state.position_boot_us, 0) * 1e-6, MEAN_MEMORY_S)
        before_us, state.position_boot_us = state.position_boot_us, now_us
        if last is None or math.dist(last, asked) > JUMP_M:
            state.mean_m = error_m
        is_loud = error_m - state.mean_m >= BOUND_M
        if not is_loud:
            state.mean_m += elapsed_s / MEAN_MEMORY_S * (error_m - state.mean_m)
        # Thrown back from the setpoint with what it takes to be left behind this far in the time of the mean.
        force = ned_to_body(state.attitude_wxyz, behind)
        free_until_us = before_us - round(1e6 * MEAN_MEMORY_S)
        return judge(state, now_us, free_until_us, force, 0.0, is_loud, situation.off_reason)
