"""The last thing that happens to a setpoint before it is sent: the envelope, and a word when it held something back."""

from dataclasses import dataclass

from companion.flight.context import FlightContext, Target
from companion.flight.envelope import Surroundings, bounded
from companion.flight.remembering import known_surfaces
from companion.messages import Vector3

# A setpoint at the edge of the envelope may cross it fifty times a second.
LEAST_BETWEEN_LIMITS_US = 1_000_000


@dataclass(slots=True)
class Limiter:
    """What was last sent, and what was last said about it."""

    last: Target | None = None
    last_ned_m: Vector3 | None = None
    last_us: int = 0
    limited_by: str = ""
    told_us: int = 0

    def passed(self, flight: FlightContext, wanted: Target, has_floor: bool, moved: bool, now_us: int) -> Target:
        """The setpoint as the fence and the limits let it pass. `moved`: the flight has turned to something else.

        Raises SetpointError where it is not finite.
        """
        latest = flight.vehicle.history.latest()
        around = Surroundings(
            vehicle_ned_m=None if latest is None else latest.position_ned_m,
            origin_ned_m=flight.origin_ned_m,
            has_floor=has_floor,
            last_ned_m=None if moved else self.last_ned_m,
            since_last_s=(now_us - self.last_us) * 1e-6,
            velocity_ned_m_s=None if latest is None else latest.velocity_ned_m_s,
            known=known_surfaces(flight),
        )
        target, reason = bounded(wanted, around, flight.mission.fence, flight.mission.limits)
        if reason != self.limited_by and now_us - self.told_us >= LEAST_BETWEEN_LIMITS_US:
            self.limited_by, self.told_us = reason, now_us
            text = f"setpoint held back: {reason}" if reason else "setpoint free again"
            flight.tell(now_us, "envelope", text, reason=reason)
        self.last = target
        # A place that is not asked for is no step from it to the next.
        self.last_ned_m, self.last_us = None if target.leans_only else target.position_ned_m, now_us
        return target
