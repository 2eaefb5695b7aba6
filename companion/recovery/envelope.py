"""The fence, applied to whatever a recovery law asks for."""

import math
from dataclasses import dataclass

from companion.messages import Vector3


@dataclass(frozen=True, slots=True)
class Envelope:
    """The mission's fence, placed at the arming position; local NED, metres."""

    origin_ned_m: Vector3
    radius_m: float
    max_height_m: float

    def clamp(self, contact_ned_m: Vector3, setpoint_ned_m: Vector3) -> Vector3:
        """Shorten the way from the contact to the setpoint so that it ends inside the fence.

        A contact that is itself outside is answered with the nearest place inside.
        """
        north_m, east_m, down_m = self.origin_ned_m
        start = (contact_ned_m[0] - north_m, contact_ned_m[1] - east_m)
        end = (setpoint_ned_m[0] - north_m, setpoint_ned_m[1] - east_m)
        if math.hypot(*end) > self.radius_m:
            end = self._shortened(start, end)
        return (north_m + end[0], east_m + end[1], max(setpoint_ned_m[2], down_m - self.max_height_m))

    def _shortened(self, start: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
        if math.hypot(*start) > self.radius_m:
            scale = self.radius_m / math.hypot(*end)
            return (end[0] * scale, end[1] * scale)
        # |start + s * way| = radius, for the s in [0, 1] that leaves the circle
        way = (end[0] - start[0], end[1] - start[1])
        a = way[0] ** 2 + way[1] ** 2
        b = start[0] * way[0] + start[1] * way[1]
        c = start[0] ** 2 + start[1] ** 2 - self.radius_m**2
        s = (-b + math.sqrt(max(0.0, b * b - a * c))) / a
        return (start[0] + s * way[0], start[1] + s * way[1])
