"""What an operator at a ground station reads and plots: short texts for the flight's events, numbers of the detector.

STATUSTEXT, NAMED_VALUE_FLOAT and DEBUG_VECT reach QGroundControl through PX4, which forwards what a companion sends
on links with MAV_x_FORWARD, or over the ground station's own link to the companion.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from companion.detection.interface import Phase
from companion.detection.watch import Watch
from companion.flight.collision import CollisionRecord
from companion.messages import DebugVector, NamedValue, Severity, StatusText
from companion.report import Event, JsonValue

# Numbers for plots.
_PHASE_NUMBER = {Phase.OFF: 0.0, Phase.QUIET: 1.0, Phase.ARMED: 2.0, Phase.CONTACT: 3.0}
_BLIND = -1.0

_COMPASS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")
# Slower than this a hit came to the vehicle, and from where is told by the push.
_LEAST_SPEED_M_S = 0.3
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


def status_text(event: Event, mission: str, hits: int) -> StatusText | None:
    """The event in 50 characters or a little more, or None when it is not for the operator."""
    words = _WORDS.get(event.kind)
    return None if words is None else words(event, mission, hits)


def _hit(event: Event, mission: str, hits: int) -> StatusText:
    data = event.data
    speed_m_s, force_m_s2 = _number(data, "impact_speed_m_s"), _number(data, "specific_force_m_s2")
    moving = speed_m_s >= _LEAST_SPEED_M_S
    towards = _direction(data["impact_velocity_ned_m_s"]) if moving else _direction(data["normal_ned"])
    how = f"at {speed_m_s:.2f} m/s going {towards}" if moving else f"pushed {towards}"
    return StatusText(Severity.WARNING, f"Hit {hits}: {how}, {force_m_s2:.0f} m/s2")


def _recovered(event: Event, mission: str, hits: int) -> StatusText:
    if event.data.get("settled_after_s") is None:
        return StatusText(Severity.WARNING, "Not recovered in time, going on")
    settled_s, overshoot_m = _number(event.data, "settled_after_s"), _number(event.data, "overshoot_m")
    return StatusText(Severity.NOTICE, f"Recovered in {settled_s:.2f} s, {100.0 * overshoot_m:.1f} cm too far")


def _ended(event: Event, mission: str, hits: int) -> StatusText:
    outcome = str(event.data["outcome"])
    severity = Severity.INFO if outcome == "completed" else Severity.ERROR
    why = "" if outcome == "completed" else f": {event.data.get('reason', '')}"
    return StatusText(severity, f"Mission {mission} {outcome}, hits: {hits}{why}")


def _began(event: Event, mission: str, hits: int) -> StatusText:
    return StatusText(Severity.INFO, f"Mission {mission} begins")


def _as_it_stands(event: Event, mission: str, hits: int) -> StatusText:
    return StatusText(Severity.WARNING, event.text[:1].upper() + event.text[1:])


def _fault(event: Event, mission: str, hits: int) -> StatusText:
    return StatusText(Severity.ERROR, "Fault in the companion, vehicle handed over")


_WORDS: Mapping[str, Callable[[Event, str, int], StatusText]] = {
    "armed": _began,
    "detection": _hit,
    "in_the_way": _as_it_stands,
    "recovered": _recovered,
    "policy": _as_it_stands,
    "unreachable": _as_it_stands,
    "timeout": _as_it_stands,
    "envelope": _as_it_stands,
    "link": _as_it_stands,
    "implausible": _as_it_stands,
    "unconfirmed": _as_it_stands,
    "take_over": _as_it_stands,
    "given_back": _as_it_stands,
    "let_go": _as_it_stands,
    "refused": _as_it_stands,
    "crossed": _as_it_stands,
    "left_alone": _as_it_stands,
    "lost": _as_it_stands,
    "late": _as_it_stands,
    "round_trip": _as_it_stands,
    "fault": _fault,
    "done": _ended,
    "aborted": _ended,
}


def values(
    state: Enum, watch: Watch, latest: CollisionRecord | None, hits: int, time_us: int
) -> list[NamedValue | DebugVector]:
    """The detector's numbers: phase, threshold and the latest hit's; and the state's, its place among all states."""
    phase = _PHASE_NUMBER[watch.state.phase] if watch.blind_reason is None else _BLIND
    sent: list[NamedValue | DebugVector] = [
        NamedValue(time_us, "rb_state", float(list(type(state)).index(state))),
        NamedValue(time_us, "rb_phase", phase),
        NamedValue(time_us, "rb_thresh", watch.state.threshold_m_s2),
        NamedValue(time_us, "rb_hits", float(hits)),
    ]
    if latest is not None:
        report = latest.report()
        sent.append(NamedValue(time_us, "rb_peak", report.peak_specific_force_m_s2))
        sent.append(DebugVector(time_us, "rb_v_c", report.impact_velocity_ned_m_s))
        sent.append(DebugVector(time_us, "rb_normal", report.normal_ned))
    return sent


def _direction(vector: JsonValue) -> str:
    """Of a NED vector, the nearest of eight points of the compass, or up or down."""
    assert isinstance(vector, tuple)
    north, east, down = vector
    assert isinstance(north, float) and isinstance(east, float) and isinstance(down, float)
    if abs(down) > math.hypot(north, east):
        return "down" if down > 0.0 else "up"
    return _COMPASS[round(math.atan2(east, north) / (math.tau / 8.0)) % 8]


def _number(data: Mapping[str, JsonValue], key: str) -> float:
    value = data[key]
    assert isinstance(value, float | int)
    return float(value)
