"""State mission: one item after the other; state holding: the pause after a recovery."""

import math

from companion.flight.context import FlightContext, Inputs, Move, Target
from companion.flight.plan import describe_item
from companion.flight.states import Trigger
from companion.flight.trajectory import LineProfile
from companion.mission.model import GoToItem, HoldItem

# Below PX4's MC_YAWRATE_MAX (200 deg/s) and its MPC_YAWRAUTO_MAX (45 deg/s): the vehicle can follow.
YAW_RATE_RAD_S = math.radians(45.0)


class FlyItems:
    """From `flight.item_index` on, until the item is land. Every item starts where the last setpoint was."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        self._begin(flight, now_us)

    def _begin(self, flight: FlightContext, now_us: int) -> None:
        """Take up the present item: a way to go (of no length for a hold) and a heading to turn to."""
        item = flight.mission.items[flight.item_index]
        assert flight.target is not None, "setpoints have been streamed since before take-off"
        start = flight.target.position_ned_m
        self._action = item.action
        self._started_us = now_us
        self._yaw_from_rad = self._yaw_to_rad = flight.yaw_rad
        self._line = LineProfile(start, start, 1.0, 1.0)
        if isinstance(self._action, GoToItem):
            goal = flight.local_ned_m(self._action.position_ned_m)
            self._line = LineProfile(start, goal, self._action.speed_m_s, self._action.acceleration_m_s2)
            if self._action.yaw_deg is not None:
                self._yaw_to_rad = math.radians(self._action.yaw_deg)
        text = f"item {flight.item_index + 1} of {len(flight.mission.items)}: {describe_item(self._action)}"
        flight.tell(now_us, "item", text, number=flight.item_index + 1, name=item.name)

    def target(self, now_us: int) -> Target | None:
        elapsed_s = (now_us - self._started_us) * 1e-6
        position, velocity, acceleration = self._line.at(elapsed_s)
        yaw_rad = self._yaw_at(elapsed_s)
        if elapsed_s >= self._line.duration_s:
            return Target(position, yaw_rad)
        # Without the acceleration the vehicle falls behind the line as it speeds up and then overruns the speed.
        return Target(position, yaw_rad, velocity, acceleration)

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Move | None:
        elapsed_s = (now_us - self._started_us) * 1e-6
        match self._action:
            case HoldItem(duration_s=duration_s):
                done = elapsed_s >= duration_s
            case GoToItem():
                overdue_s = elapsed_s - max(self._line.duration_s, self._turn_s())
                done = overdue_s >= 0.0 and self._arrived(flight)
                if not done and overdue_s > flight.mission.companion.flight.arrival_timeout_s:
                    return Move(Trigger.INTERRUPTED, f"not arrived: {describe_item(self._action)}", hand_over=True)
            case _:
                return Move(Trigger.ITEMS_DONE)
        if done:
            flight.yaw_rad = self._yaw_to_rad
            flight.target = self.target(now_us)
            flight.item_index += 1
            self._begin(flight, now_us)
            return self.step(flight, inputs, now_us)
        return None

    def _arrived(self, flight: FlightContext) -> bool:
        latest = flight.vehicle.history.latest()
        radius_m = flight.mission.companion.flight.acceptance_radius_m
        return latest is not None and math.dist(latest.position_ned_m, self._line.target_m) <= radius_m

    def _turn_rad(self) -> float:
        """The shorter way round, clockwise positive."""
        if self._yaw_from_rad is None or self._yaw_to_rad is None:
            return 0.0
        return math.remainder(self._yaw_to_rad - self._yaw_from_rad, math.tau)

    def _turn_s(self) -> float:
        return abs(self._turn_rad()) / YAW_RATE_RAD_S

    def _yaw_at(self, elapsed_s: float) -> float | None:
        if self._yaw_from_rad is None or elapsed_s >= self._turn_s():
            return self._yaw_to_rad
        return self._yaw_from_rad + math.copysign(YAW_RATE_RAD_S * elapsed_s, self._turn_rad())


class HoldAfterRecovery:
    """Stay at the recovery setpoint for the mission's time."""

    def __init__(self, flight: FlightContext, now_us: int) -> None:
        hold_s = flight.mission.on_collision.hold_s
        self._until_us = now_us + round(hold_s * 1e6)
        self._target = flight.target
        flight.tell(now_us, "hold", f"holding for {hold_s:g} s", hold_s=hold_s)

    def target(self, now_us: int) -> Target | None:
        return self._target

    def step(self, flight: FlightContext, inputs: Inputs, now_us: int) -> Move | None:
        return Move(Trigger.HOLD_ENDED) if now_us >= self._until_us else None
