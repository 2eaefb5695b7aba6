"""`rebound fly MISSION --resume RUN`: from the folder of an interrupted flight, where to take it up again."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from companion.errors import ConfigurationError
from companion.mission.model import Mission
from rebound_cli.documents import Document, Override, apply_override
from rebound_cli.inputs import load_flown, mission_from
from rebound_cli.run_folder import EVENTS_NAME, OBSTACLES_NAME, RESOLVED_NAME, read_records, read_text, whole_lines


class ResumeError(ConfigurationError):
    """There is nothing to go on with, or it is not this mission's."""


def resume_of(run: Path, mission: Mission) -> dict[str, Any]:
    """The mission's `resume:` part. Works for flights that ended early, and for those whose process was killed."""
    flown = mission_from(load_flown(run / RESOLVED_NAME))
    if flown.items != mission.items:
        raise ResumeError(f"{run} is not a flight of this mission: its items are others.")
    events = list(read_records(run / EVENTS_NAME, whole_lines(read_text(run / EVENTS_NAME))))
    armed = _last(events, "armed")
    item, end = _last(events, "item"), _last(events, "aborted")
    if _last(events, "done") is not None:
        raise ResumeError(f"{run} was flown to its end: there is nothing to resume.")
    if armed is None or item is None:
        raise ResumeError(f"{run} ended before its first item: fly it from the start.")
    try:
        at_step = int((end or item)["data"].get("next_step", item["data"]["step"]))
        return {
            "at_step": max(1, at_step),
            "origin_ned_m": [float(axis) for axis in armed["data"]["origin_ned_m"]],
            "armed_at_us": armed["time_us"],
            "armed_boot_us": armed["data"]["time_boot_us"],
            "hits": sum(event["kind"] == "detection" for event in events) + (flown.resume.hits if flown.resume else 0),
        }
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ResumeError(f"{run / EVENTS_NAME}: not the events of a flight; the file is damaged.") from error


def remember_from(run: Path, document: Document) -> None:
    """What the interrupted flight knew of its surroundings takes the place of what the mission says is known."""
    stored = run / OBSTACLES_NAME
    if stored.exists():
        apply_override(document, Override(f"--resume {run}", ("obstacles", "known"), []))
        apply_override(document, Override(f"--resume {run}", ("obstacles", "file"), str(stored)))


def _last(events: Sequence[dict[str, Any]], kind: str) -> dict[str, Any] | None:
    return next((event for event in reversed(events) if event["kind"] == kind), None)
