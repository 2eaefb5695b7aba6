"""The mission's fence as a recovery sees it."""

from dataclasses import dataclass

from companion.messages import Vector3
from companion.mission.fence import Fence


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
