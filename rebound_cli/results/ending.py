"""The end of a flight in words: what a pilot asks. Every figure behind it is in summary.json."""

import math
from collections.abc import Mapping, Sequence
from typing import Any


def ending_text(summary: Mapping[str, Any]) -> str:
    """A headline, a line for each hit, and what else happened, where it did."""
    collisions = summary["collisions"]
    lines = [_headline(summary), ""]
    for number, collision in enumerate(collisions, start=1):
        lead = f"{number}. " if len(collisions) > 1 else ""
        if collision["truth"] is None and summary["false_detections"] is not None:
            lines.append(f"{lead}False alarm: no new contact.")
        else:
            lines.append(lead + _collision(collision))
    if not collisions:
        lines.append("No hit.")
    if summary["outcome"] == "completed" and len(collisions) == 1:
        lines[-1] = lines[-1].removesuffix(".") + ", landed safely."
    elif summary["outcome"] == "completed":
        lines.append("Landed safely.")
    return "\n".join(lines + _counts(summary) + _surroundings(summary))


def _headline(summary: Mapping[str, Any]) -> str:
    airframe = summary["airframe"]
    vehicle = "" if airframe is None else f" with the {airframe} airframe, seed {summary['seed']}"
    reason = "" if summary["outcome"] == "completed" else f": {summary['reason']}"
    pace = f"{summary['duration_s']:.1f} s of flight in {summary['wall_clock_s']:.1f} s"
    return f"{summary['mission']} {summary['outcome']}{reason} ({pace}{vehicle})"


def _collision(collision: Mapping[str, Any]) -> str:
    """By the simulator's figures where it knows them, by telemetry on a real vehicle."""
    truth = collision["truth"]
    settled_s = collision["settled_after_s"]
    if truth is None:
        hit, seen, height = f"Hit something at {collision['impact_speed_m_s']:.2f} m/s.", "", ""
    else:
        hit = f"Hit {impact_text(truth['kind'], truth['impact_velocity_ned_m_s'])}."
        seen = f" Seen after {truth['detection_latency_ms']:.1f} ms."
        lost_m = truth["height_lost_m"]
        height = f", {f'{lost_m:.1f} m' if lost_m >= 1.0 else f'{100 * lost_m:.0f} cm'} of height lost"
    off_m = (truth or collision)["stopped_off_m"]
    if settled_s is None:
        stopped = f"Not yet still when the flight went on{height}."
    else:
        stopped = f"Stopped {off_m:.1f} m off it in {settled_s:.1f} s{height}."
    return f"{hit}{seen} {stopped}"


def impact_text(kind: str, velocity_ned_m_s: Sequence[float]) -> str:
    """What was hit, and how fast."""
    return f"{'an' if kind == 'edge' else 'a'} {kind} at {math.hypot(*velocity_ned_m_s):.2f} m/s"


def _counts(summary: Mapping[str, Any]) -> list[str]:
    """What a simulated flight must not have, and a real one cannot know."""
    counts = {
        "missed_contacts": "not seen",
        "recontacts": "before the vehicle had recovered from the one before",
        "unconfirmed": "shown by one message and confirmed by nothing",
    }
    return [
        f"{count} hit{'s' if count > 1 else ''} {what}." for key, what in counts.items() if (count := summary[key] or 0)
    ]


def _surroundings(summary: Mapping[str, Any]) -> list[str]:
    """What is known at the end, and what could not be reached for it."""
    from companion.memory.patch import Patch
    from companion.memory.stored import describe

    lines = [f"Remembered: {describe(Patch.model_validate(data))}." for data in summary["obstacles"]]
    return lines + [f"Out of reach: {name if name == 'home' else f'item {name}'}." for name in summary["unreachable"]]
