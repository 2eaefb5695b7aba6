"""From a mission item to its trajectory, round known obstacles. Mission coordinates, metres."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

from companion.fence import Fence
from companion.memory.surroundings import ROUNDING_M, ObstacleMap, route
from companion.messages import Vector3
from companion.mission import items
from companion.mission.trajectory import LEAST_GAP_M, Chain, CircleProfile, CurveProfile, LineProfile, Trajectory
from companion.motion.vector import along, flat, minus, plus, unit

# Least acceleration against a strong wind: 4 m/s after ten seconds.
LEAST_SPEEDING_UP_M_S2 = 0.4
# A retry slower than this may touch without a detection, and push until its time-out.
LEAST_TRY_M_S = 0.3


@dataclass(frozen=True, slots=True)
class SpeedLimits:
    """Speed and acceleration of items that state none; `factor` slows down an item that is tried again.

    `speeding_up_m_s2` holds for all items.
    """

    speed_m_s: float
    acceleration_m_s2: float
    factor: float = 1.0
    speeding_up_m_s2: float = math.inf

    def changed_to(self, item: items.SetSpeedItem) -> "SpeedLimits":
        acceleration_m_s2 = item.acceleration_m_s2 or self.acceleration_m_s2
        return replace(self, speed_m_s=item.speed_m_s, acceleration_m_s2=acceleration_m_s2)

    def against(self, wind_m_s2: Vector3, way: Vector3) -> "SpeedLimits":
        """With the acceleration that a head wind leaves; `wind_m_s2`: what balances the wind in hover, horizontal."""
        head_m_s2 = max(0.0, along(wind_m_s2, unit(flat(way))))
        least = min(LEAST_SPEEDING_UP_M_S2, self.speeding_up_m_s2)
        return replace(self, speeding_up_m_s2=max(least, self.speeding_up_m_s2 - head_m_s2))

    def limits(self, item: items.Motion | items.ReturnItem) -> tuple[float, float, float]:
        """Speed and acceleration, the item's or the present ones; and the acceleration while the speed grows."""
        speed_m_s = slowed_m_s(item.speed_m_s or self.speed_m_s, self.factor)
        return speed_m_s, getattr(item, "acceleration_m_s2", None) or self.acceleration_m_s2, self.speeding_up_m_s2


def slowed_m_s(speed_m_s: float, factor: float) -> float:
    """Of an item that is tried again."""
    return max(speed_m_s * factor, min(speed_m_s, LEAST_TRY_M_S))


def stay(place_m: Vector3) -> LineProfile:
    return LineProfile(place_m, place_m, 1.0, 1.0)


def first_leg(item: items.Motion, start_m: Vector3) -> Vector3:
    """The vector to the item's first point; of an orbit, to its centre, as all directions follow."""
    match item:
        case items.VelocityItem(velocity_ned_m_s=velocity):
            return velocity
        case items.GoToItem(position_ned_m=first) | items.OrbitItem(centre_ned_m=first):
            return minus(first, start_m)
        case items.PathItem(points_ned_m=points):
            return minus(points[0], start_m)


def trajectory_of(item: items.Motion, start_m: Vector3, speeds: SpeedLimits) -> Trajectory:
    """The item's trajectory from the present setpoint."""
    limits = speeds.limits(item)
    match item:
        case items.GoToItem():
            return LineProfile(start_m, item.position_ned_m, *limits)
        case items.PathItem():
            return CurveProfile((start_m, *item.points_ned_m), *limits)
        case items.VelocityItem():
            # The line that is covered in the time.
            speed_m_s, braking, speeding_up = limits
            ahead = unit(item.velocity_ned_m_s)
            level = math.hypot(*ahead[:2])
            growth = min(braking, speeding_up / level) if level > 0.0 else braking
            # With ramps of top / acceleration at both ends; a time too short for the speed is all ramps.
            ramps_s2_per_m = 0.5 / growth + 0.5 / braking
            top = min(speed_m_s, 0.5 * item.duration_s / ramps_s2_per_m)
            length = top * (item.duration_s - top * ramps_s2_per_m)
            return LineProfile(start_m, plus(start_m, length, ahead), top, braking, speeding_up)
        case items.OrbitItem():
            # To the nearest point of the circle, which for a start in its middle is the one in the north, and round.
            n, e, _ = item.centre_ned_m
            start_rad = math.atan2(start_m[1] - e, start_m[0] - n)
            angle_rad = math.tau * item.turns * (1.0 if item.clockwise else -1.0)
            circle = CircleProfile(item.centre_ned_m, item.radius_m, start_rad, angle_rad, *limits)
            return Chain((LineProfile(start_m, circle.at(0.0)[0], *limits), circle))


# A curve is looked at in steps of half a guard; a longer one in so many.
LOOK_EVERY_M = 0.1
MOST_LOOKS = 2_000
# A circle that cannot be flown as one is flown by its points: 24 differ from it by less than 1 % of the radius.
ROUND_BY_DEG = 15.0


@dataclass(frozen=True, slots=True)
class Planned:
    """A trajectory of an item; None where none is free of known obstacles.

    `is_detour`: another than the item's own. `left_out`: how many of the item's points lie in known obstacles.
    """

    trajectory: Trajectory | None
    is_detour: bool = False
    left_out: int = 0


@lru_cache(maxsize=512)  # the laps of a repeat and the turns of an orbit mostly go the same ways
def trajectory_around(item: items.Motion, start_m: Vector3, speeds: SpeedLimits, known: ObstacleMap) -> Planned:
    """The item's own trajectory where that is free. A velocity item is flown as it is: it has no goal."""
    own, limits = trajectory_of(item, start_m, speeds), speeds.limits(item)
    if isinstance(item, items.VelocityItem) or not _is_blocked(own, known):
        return Planned(own)
    is_round, points = isinstance(item, items.OrbitItem), list[Vector3]()
    match item, own:
        case items.OrbitItem(turns=turns), Chain(parts=[_, circle]):
            if turns > 1.0:
                return _turn_by_turn(item, start_m, speeds, known)
            count = math.ceil(360.0 * turns / ROUND_BY_DEG)
            # Evenly in time is nearly evenly round, as a circle's ramps are short.
            points = [circle.at(circle.duration_s * number / count)[0] for number in range(count + 1)]
        case items.PathItem(points_ned_m=given), _:
            points = list(given)
        case items.GoToItem(position_ned_m=goal), _:
            points = [goal]
    places, left_out = [start_m], 0
    for point in points:
        found = route(known, places[-1], point) if not is_round or known.is_clear(point, start_m) else None
        left_out += found is None
        places += found or ()
    # Of a circle any part is worth flying; a line or a path has somewhere to be.
    if len(places) == 1 or (not is_round and places[-1] != points[-1]):
        return Planned(None)
    if not isinstance(item, items.GoToItem):
        curve = CurveProfile(places, *limits)
        places_on_it = looks(curve)
        if not known.block(places_on_it) and all(known.fence.complaint(place) is None for place in places_on_it):
            return Planned(curve, True, left_out)
    return Planned(_lines(places, limits), True, left_out)


def _turn_by_turn(item: items.OrbitItem, start_m: Vector3, speeds: SpeedLimits, known: ObstacleMap) -> Planned:
    """At rest after each turn. Turns from one place are planned once: while one is planned, no setpoint is sent."""
    turns, place = list[Planned](), start_m
    for number in range(math.ceil(item.turns)):
        turn = item.model_copy(update={"turns": min(1.0, item.turns - number)})
        turns.append(trajectory_around(turn, place, speeds, known))
        end = place if turns[-1].trajectory is None else turns[-1].trajectory.target_m
        place = place if math.dist(end, place) < LEAST_GAP_M else end
    flown = [turn.trajectory for turn in turns if turn.trajectory is not None]
    return Planned(Chain(flown) if flown else None, True, sum(turn.left_out for turn in turns))


def home_around(start_m: Vector3, item: items.ReturnItem, speeds: SpeedLimits, known: ObstacleMap) -> Planned:
    """Up first where that is asked for, then straight to above the arming position, never above the fence; round known
    obstacles, also above the vehicle."""
    wanted_m = max(-start_m[2], item.height_m or 0.0)
    down_m = -min(max(wanted_m, known.fence.min_height_m), known.fence.max_height_m)
    up, home, limits = (start_m[0], start_m[1], down_m), (0.0, 0.0, down_m), speeds.limits(item)
    own = _lines((start_m, up, home), limits)
    if not _is_blocked(own, known):
        return Planned(own)
    places = [start_m] if known.block((start_m, up)) else [start_m, up]
    found = route(known, places[-1], home)
    return Planned(None) if found is None else Planned(_lines([*places, *found], limits), True)


def _lines(places_m: Sequence[Vector3], limits: tuple[float, float, float]) -> Chain:
    return Chain([LineProfile(a, b, *limits) for a, b in pairwise(places_m)])


def left_of(item: items.Motion, trajectory: Trajectory, elapsed_s: float) -> items.Motion:
    """What is left of an interrupted item. Of a path: its points that the trajectory still passes."""
    left_s = trajectory.duration_s - elapsed_s
    if left_s <= 0.0:
        return items.GoToItem(position_ned_m=trajectory.target_m)
    match item, trajectory:
        case items.VelocityItem(), _:
            return item.model_copy(update={"duration_s": left_s})
        case items.OrbitItem(), Chain(parts=[_, CircleProfile(duration_s=round_s)]):
            return item.model_copy(update={"turns": item.turns * min(1.0, left_s / round_s)})
        case items.PathItem(points_ned_m=points), Chain() | CurveProfile():
            ahead = [place for at_s, place in trajectory.passes if at_s > elapsed_s and place in points]
            return item.model_copy(update={"points_ned_m": tuple(ahead) or points[-1:]})
    return item


def looks(trajectory: Trajectory) -> list[Vector3]:
    """Points of a trajectory, near to one another; of a circle once round."""
    if isinstance(trajectory, CircleProfile):
        trajectory = replace(trajectory, angle_rad=max(-math.tau, min(math.tau, trajectory.angle_rad)))
    count = max(1, min(MOST_LOOKS, math.ceil(trajectory.distance_m / LOOK_EVERY_M)))
    return [trajectory.at(trajectory.duration_s * number / count)[0] for number in range(count + 1)]


def _is_blocked(trajectory: Trajectory, known: ObstacleMap) -> bool:
    if isinstance(trajectory, Chain):
        return any(_is_blocked(part, known) for part in trajectory.parts)
    if known.keeps_in and _leaves(trajectory, known.fence):
        return True
    if not known.patches:
        return False
    ends = (trajectory.start_m, trajectory.target_m) if isinstance(trajectory, LineProfile) else looks(trajectory)
    return known.block(ends)


def _leaves(trajectory: Trajectory, fence: Fence) -> bool:
    """Whether it leaves a polygon in which it begins. What has come out of it flies in."""
    if fence.polygon_ne_m is None or fence.outside_by_m(trajectory.at(0.0)[0]) > 0.0:
        return False
    if isinstance(trajectory, LineProfile):
        end = trajectory.target_m[:2]
        return math.dist(fence.shortened(trajectory.start_m[:2], end), end) > ROUNDING_M
    return any(fence.outside_by_m(place) > ROUNDING_M for place in looks(trajectory))
