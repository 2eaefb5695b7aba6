"""What no recovery law knows of: the fence, and the wall that was hit just before."""

from dataclasses import dataclass

from companion.messages import Vector3
from companion.mission.fence import Fence

# Cosine between two normals below which the walls face each other, as in a corridor: away from one is towards the
# other, and nothing can be asked of both. Walls of a corner are at 0.
FACING_EACH_OTHER = -0.5


def away_from_both(
    setpoint_ned_m: Vector3, normal_ned: Vector3, earlier_setpoint_ned_m: Vector3, earlier_normal_ned: Vector3
) -> Vector3:
    """The setpoint after a second hit, no nearer to the first wall than the first hit's setpoint.

    In a corner the second hit comes while the vehicle leaves the first wall, and what leads back from the second
    along its approach leads into the first.
    """
    if sum(a * b for a, b in zip(normal_ned, earlier_normal_ned, strict=True)) < FACING_EACH_OTHER:
        return setpoint_ned_m
    n, e, d = earlier_normal_ned
    x, y, z = setpoint_ned_m
    short_m = (
        n * (earlier_setpoint_ned_m[0] - x) + e * (earlier_setpoint_ned_m[1] - y) + d * (earlier_setpoint_ned_m[2] - z)
    )
    return setpoint_ned_m if short_m <= 0.0 else (x + short_m * n, y + short_m * e, z + short_m * d)


@dataclass(frozen=True, slots=True)
class Envelope:
    """The mission's fence, placed at the arming position; local NED, metres."""

    origin_ned_m: Vector3
    fence: Fence

    def clamp(self, contact_ned_m: Vector3, setpoint_ned_m: Vector3) -> Vector3:
        """Shorten the way from the contact to the setpoint so that it ends inside the fence.

        A contact that is itself outside is answered with the nearest place inside.
        """
        north_m, east_m, down_m = self.origin_ned_m
        start = (contact_ned_m[0] - north_m, contact_ned_m[1] - east_m)
        end = (setpoint_ned_m[0] - north_m, setpoint_ned_m[1] - east_m)
        end = self.fence.shortened(start, end) if self.fence.contains(*start) else self.fence.nearest_inside(*end)
        top_m, floor_m = down_m - self.fence.max_height_m, down_m - self.fence.min_height_m
        return (north_m + end[0], east_m + end[1], min(max(setpoint_ned_m[2], top_m), floor_m))
