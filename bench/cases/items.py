"""Random items: where to, how fast, what after a hit. Goals lie in the open or on the far side of an obstacle."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bench.cases.draw import DIGITS, Draw, NorthEast, towards
from bench.cases.rooms import DrawnRoom

Part = dict[str, Any]

SPEEDS_M_S = (0.5, 4.0)
# Up to PX4's own default for missions, MPC_ACC_HOR.
ACCELERATIONS_M_S2 = (1.5, 3.0)
# A motion item takes about so long at most: missions are many and shall be short.
LONGEST_ITEM_S = 8.0
# Most goals shall lead into something: that is what is to be shown.
AIMED_SHARE = 0.65
LOWEST_M = 0.8


@dataclass(slots=True)
class Route:
    """Where the mission would be, were nothing hit."""

    draw: Draw
    room: DrawnRoom
    place_ne_m: NorthEast
    height_m: float

    def goal(self, speed_m_s: float) -> list[float]:
        """A place for the next item, and from then on the route's own."""
        draw, room = self.draw, self.room
        longest_m = LONGEST_ITEM_S * speed_m_s
        if room.aims and draw.happens(AIMED_SHARE) and not room.is_fenced_by_walls:
            aim = draw.one_of(room.aims)
            aim = (aim[0] + draw.number(-0.3, 0.3), aim[1] + draw.number(-0.3, 0.3))
            bearing = math.atan2(aim[1] - self.place_ne_m[1], aim[0] - self.place_ne_m[0])
            distance_m = min(math.dist(aim, self.place_ne_m) + draw.number(0.3, 2.0), max(longest_m, 1.0))
            place = towards(self.place_ne_m, bearing, distance_m)
        else:
            place = towards((0.0, 0.0), draw.heading(), draw.number(0.0, max(0.4, room.inside_m)))
        if draw.happens(0.4):
            self.height_m = draw.number(LOWEST_M, room.highest_m)
        self.place_ne_m = place
        return [*place, -self.height_m]


def motion_item(route: Route) -> Part:
    """A go_to, path, orbit or velocity item."""
    return route.draw.one_of((_go_to, _velocity, _path, _orbit, _up), (5.0, 2.0, 2.0, 1.0, 0.7))(route)


def quiet_item(route: Route) -> Part | None:
    """Something between two motions, or nothing."""
    draw = route.draw
    kinds: tuple[Callable[[], Part | None], ...] = (
        lambda: None,
        lambda: {"hold": {"duration_s": draw.number(0.5, 1.5)}},
        lambda: {"set_yaw": {"yaw_deg": float(draw.whole(-180, 180)), "rate_deg_s": 90.0}},
        lambda: {"set_speed": {"speed_m_s": _speed(draw)}},
        lambda: {
            "wait_for": {"steady": {"within_m": 0.4, "speed_m_s": 0.3}},
            "timeout_s": 4.0,
            "on_timeout": "continue",
        },
    )
    return draw.one_of(kinds, (6.0, 1.0, 1.0, 1.0, 0.5))()


def policy(draw: Draw) -> Part:
    """What follows a hit."""
    then = draw.one_of(("detour", "hold", "continue", "retry", "return", "land"), (3.0, 2.0, 2.0, 2.0, 1.5, 1.5))
    found: Part = {"then": then, "max_hits": draw.whole(1, 5)}
    if then == "hold":
        found["hold_s"] = draw.number(0.5, 1.5)
    if then == "retry":
        found["retry_speed_factor"] = draw.one_of((0.5, 0.7))
    return found | {"after_max_hits": draw.one_of(("land", "return", "abort"), (4.0, 4.0, 1.0))}


def _speed(draw: Draw) -> float:
    return draw.number(*SPEEDS_M_S)


def _pace(draw: Draw) -> tuple[Part, float]:
    """Speed and acceleration of an item, and the speed."""
    speed = _speed(draw)
    return {"speed_m_s": speed, "acceleration_m_s2": draw.number(*ACCELERATIONS_M_S2)}, speed


def _yaw(draw: Draw, *words: str) -> Part:
    if not draw.happens(0.4):
        return {}
    return {"yaw_deg": draw.one_of(words) if words and draw.happens(0.5) else float(draw.whole(-180, 180))}


def _go_to(route: Route) -> Part:
    pace, speed = _pace(route.draw)
    return {"go_to": {"position_ned_m": route.goal(speed), **pace, **_yaw(route.draw)}}


def _path(route: Route) -> Part:
    pace, speed = _pace(route.draw)
    points = [route.goal(0.6 * speed) for _ in range(route.draw.whole(2, 3))]
    return {"path": {"points_ned_m": points, **pace, **_yaw(route.draw, "along")}}


def _velocity(route: Route) -> Part:
    """Towards the next goal, for as long as it takes there."""
    draw = route.draw
    speed = _speed(draw)
    start, height_m = route.place_ne_m, route.height_m
    n, e, d = route.goal(speed)
    way = (n - start[0], e - start[1], d + height_m)
    length_m = max(math.hypot(*way), 0.2)
    acceleration = draw.number(*ACCELERATIONS_M_S2)
    velocity = [round(part / length_m * speed, DIGITS) for part in way]
    if math.hypot(*velocity) < 0.1:
        velocity = [speed, 0.0, 0.0]
    # with the time of both ramps, so that it gets there
    duration_s = round(min(length_m / speed + speed / acceleration, LONGEST_ITEM_S), DIGITS)
    item = {"velocity_ned_m_s": velocity, "duration_s": duration_s, "acceleration_m_s2": acceleration}
    return {"velocity": item | _yaw(draw)}


def _orbit(route: Route) -> Part:
    """Round a place in the open or on an obstacle; no faster than the acceleration allows on such a circle."""
    draw = route.draw
    radius_m, acceleration = draw.number(0.5, 1.4), draw.number(*ACCELERATIONS_M_S2)
    speed = draw.number(0.5, min(4.0, math.sqrt(0.8 * acceleration * radius_m)))
    centre = route.goal(speed)
    turns = draw.number(0.4, max(0.5, min(1.0, LONGEST_ITEM_S * speed / (math.tau * radius_m))))
    item = {"centre_ned_m": centre, "radius_m": radius_m, "turns": turns, "clockwise": draw.happens(0.5)}
    return {"orbit": item | {"speed_m_s": speed, "acceleration_m_s2": acceleration} | _yaw(draw, "along", "centre")}


def _up(route: Route) -> Part:
    """Straight up: into the ceiling where there is one."""
    draw, room = route.draw, route.room
    if room.ceiling_m is None or room.is_fenced_by_walls:
        return _go_to(route)
    speed = draw.number(0.5, 2.5)
    place = [*route.place_ne_m, -round(room.ceiling_m + draw.number(0.1, 0.8), DIGITS)]
    return {
        "go_to": {"position_ned_m": place, "speed_m_s": speed, "acceleration_m_s2": draw.number(*ACCELERATIONS_M_S2)}
    }
