"""Whether the vehicle's own estimate may be believed after a hit that its accelerometer could not show whole.

What clipping hides of a hit is missing in the estimated velocity: a real PX4 that bounced back at 1.6 m/s said +2 m/s,
into the wall, for 0.14 s; its other sensors then put velocity and place right, by an overshoot of 15 %, within a second
(docs/px4.md). Until then both are worse than nothing: whoever flies by them leans into the obstacle or far off it.

This judges for a recovery, which must have a velocity as soon as there is a good one and knows what to expect of it: a
rebound seen at once ends the doubt, and so does a steady estimate half a second after the hit. For the detector
`estimate.trust` judges (`Watch.estimate_trusted`): it knows no law and no normal, and may wait longer, because what it
must not do is to take the estimator's correction for a second hit.
"""

import math
from collections.abc import Sequence

from companion.detection.classify import HOVER_M_S
from companion.estimate.approach import VelocityFix
from companion.estimate.trust import CORRECTED_US
from companion.messages import LocalPosition, Vector3
from companion.recovery.direction import split

# An estimate that shows this share of the approach as rebound has seen the hit: arms that meet their stops, and frames,
# give back 0.3 and more. With a tenth, arms that had clipped were believed while 0.3 to 0.7 m/s were missing.
LEAST_REBOUND = 0.3
# Along a normal that is wrong by 60 degrees or more there is no approach to compare with, and an estimate that has
# missed the hit would do: it must have changed by that share of all the speed. For a vehicle that hovered, by twice
# what an estimate has been seen to show of a hit that it missed.
STRUCK_M_S = 0.5
# Being put right begins after 0.14 s and is steep for a third of a second.
EARLIEST_US = 500_000
# By then it is over whatever the signs.
LATEST_US = 1_200_000
# Right is what goes along with the accelerometer for this long, to four times a good velocity's noise.
STEADY_US = 200_000
STEADY_M_S = 0.12


def is_believed(
    sample: LocalPosition,
    before_ned_m_s: Vector3,
    normals: Sequence[Vector3],
    fixes: Sequence[VelocityFix],
    since_us: int,
) -> bool:
    """Whether the sample's velocity and place are those of the vehicle, ``since_us`` after a hit at a velocity.

    ``normals``: NED, of the obstacle, as the push and as the approach have it.
    """
    if since_us > LATEST_US or (since_us < CORRECTED_US and any(_rebounds(sample, before_ned_m_s, n) for n in normals)):
        return True
    return since_us >= EARLIEST_US and is_steady(fixes, sample.time_boot_us)


def _rebounds(sample: LocalPosition, before_ned_m_s: Vector3, normal_ned: Vector3) -> bool:
    into_m_s, off_m_s = (split(v, normal_ned)[0] for v in (before_ned_m_s, sample.velocity_ned_m_s))
    speed_m_s = math.hypot(*before_ned_m_s)
    least_m_s = LEAST_REBOUND * speed_m_s if speed_m_s >= HOVER_M_S else STRUCK_M_S
    return off_m_s >= -LEAST_REBOUND * min(0.0, into_m_s) and off_m_s - into_m_s >= least_m_s


def is_steady(fixes: Sequence[VelocityFix], boot_us: int) -> bool:
    """Whether the estimated velocity has changed of late by what the accelerometer shows."""
    recent = [fix for fix in fixes if boot_us - fix.time_boot_us <= STEADY_US]
    if len(recent) < 3:
        return False
    missing = [[fix.velocity_ned_m_s[axis] - fix.sum_ned_m_s[axis] for fix in recent] for axis in range(3)]
    return max(max(values) - min(values) for values in missing) <= STEADY_M_S


def half_way(pushed_ned: Vector3, back_ned: Vector3) -> Vector3:
    """Away from an obstacle of which only a clipped push is known, each axis clipped alone; unit vectors.

    Back is where the vehicle came from, and free: half way between the two, or back where they are 60 degrees apart.
    """
    (n, e, d), (u, v, w) = pushed_ned, back_ned
    together = n * u + e * v + d * w
    if back_ned == (0.0, 0.0, 0.0) or together > 0.999:
        return pushed_ned
    if together < 0.5:
        return back_ned
    scale = (2.0 + 2.0 * together) ** -0.5
    return (scale * (n + u), scale * (e + v), scale * (d + w))
