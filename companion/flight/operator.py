"""What an operator at a ground station reads and plots: short texts for the flight's events, numbers of the detector.

STATUSTEXT, NAMED_VALUE_FLOAT and DEBUG_VECT reach QGroundControl through PX4, which forwards what a companion sends
on links that it is told to, or over the ground station's own link to the companion.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from companion.memory.patch import LEAST_SPEED_M_S
from companion.messages import NamedValue, Severity, StatusText, Vector3
from companion.reflex.detection.detector import Phase
from companion.reflex.detection.monitor import CollisionMonitor
from companion.reflex.recovery.collision import Collision
from companion.report import Event

_COMPASS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")
# A ground station shows a text for some seconds and keeps a list: more of one subject pushes all others out of sight.
# Once a second, as a HEARTBEAT.
TEXT_INTERVAL_US = 1_000_000


@dataclass(slots=True)
class Texts:
    """Of each kind of event one text a second: the latest, and not the one that was just sent."""

    sent: dict[str, tuple[int, StatusText]] = field(default_factory=dict)  # when, and what
    waiting: dict[str, StatusText] = field(default_factory=dict)

    def due(self, told: Iterable[tuple[str, StatusText]], is_last: bool, now_us: int) -> list[StatusText]:
        """What to send now, of what is told now and of what waits; at the last step all of it."""
        for kind, text in told:
            if self._may_go(kind, now_us) or text != self.sent[kind][1]:
                self.waiting[kind] = text
            else:
                self.waiting.pop(kind, None)
        going = [kind for kind in self.waiting if is_last or self._may_go(kind, now_us)]
        for kind in going:
            self.sent[kind] = now_us, self.waiting[kind]
        return [self.waiting.pop(kind) for kind in going]

    def _may_go(self, kind: str, now_us: int) -> bool:
        return kind not in self.sent or now_us - self.sent[kind][0] >= TEXT_INTERVAL_US


# Kinds of events that are told in their own words. What a pilot may have to act on is a warning.
_WARNING = (
    *("in_the_way", "unreachable", "timeout", "link", "implausible"),
    *("take_over", "let_go", "refused", "not_back"),
    *("left_alone", "lost", "late", "round_trip", "damage", "crash", "crashed"),
)
_NOTICE = ("policy", "envelope", "unconfirmed", "given_back")
_AS_THEY_STAND = dict.fromkeys(_WARNING, Severity.WARNING) | dict.fromkeys(_NOTICE, Severity.NOTICE)


def status_text(event: Event, mission: str, hits: int) -> StatusText | None:
    """The event in 50 characters or a little more, or None when it is not for the operator."""
    data: Mapping[str, Any] = event.data
    match event.kind:
        case "armed":
            return StatusText(Severity.INFO, f"Mission {mission} begins")
        case "detection":
            speed_m_s, force_m_s2 = data["impact_speed_m_s"], data["specific_force_m_s2"]
            # What came to the vehicle is told by its push.
            moving = speed_m_s >= LEAST_SPEED_M_S
            towards = _direction(data["impact_velocity_ned_m_s" if moving else "normal_ned"])
            how = f"at {speed_m_s:.2f} m/s going {towards}" if moving else f"pushed {towards}"
            return StatusText(Severity.WARNING, f"Hit {hits}: {how}, {force_m_s2:.0f} m/s2")
        case "recovered" if data.get("settled_after_s") is None:
            return StatusText(Severity.WARNING, "Not recovered in time, going on")
        case "recovered":
            settled_s, past_cm = data["settled_after_s"], 100.0 * data["overshoot_m"]
            return StatusText(Severity.NOTICE, f"Recovered in {settled_s:.2f} s, {past_cm:.1f} cm too far")
        case "fault":
            return StatusText(Severity.ERROR, "Fault in the companion, vehicle handed over")
        case "done" | "aborted":
            is_good = data["outcome"] == "completed"
            why = "" if is_good else f": {data.get('reason', '')}"
            severity = Severity.INFO if is_good else Severity.ERROR
            return StatusText(severity, f"Mission {mission} {data['outcome']}, hits: {hits}{why}")
        case kind if kind in _AS_THEY_STAND:
            return StatusText(_AS_THEY_STAND[kind], event.text[:1].upper() + event.text[1:])
    return None


def values(
    state: Enum, monitor: CollisionMonitor, latest: Collision | None, hits: int, time_us: int
) -> list[NamedValue]:
    """The state's and the detector's numbers: of a state and a phase its place among all, of one without data -1."""
    phase = float(list(Phase).index(monitor.state.phase)) if monitor.no_data_reason is None else -1.0
    sent = [
        NamedValue(time_us, "rb_state", float(list(type(state)).index(state))),
        NamedValue(time_us, "rb_phase", phase),
        NamedValue(time_us, "rb_thresh", monitor.state.threshold_m_s2),
        NamedValue(time_us, "rb_hits", float(hits)),
    ]
    if latest is not None:
        sent.append(NamedValue(time_us, "rb_peak", latest.peak_specific_force_m_s2))
        sent.append(NamedValue(time_us, "rb_v_c", latest.contact.velocity_ned_m_s))
        sent.append(NamedValue(time_us, "rb_normal", latest.normal.direction_ned))
    return sent


def _direction(vector_ned: Vector3) -> str:
    """The nearest of eight points of the compass, or up or down."""
    north, east, down = vector_ned
    if abs(down) > math.hypot(north, east):
        return "down" if down > 0.0 else "up"
    return _COMPASS[round(math.atan2(east, north) / (math.tau / 8.0)) % 8]
