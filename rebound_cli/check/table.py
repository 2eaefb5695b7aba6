"""A mission as a table: what, how far, how long, and what stands in the way."""

from collections.abc import Sequence

from companion.flight.plan import describe_item, describe_modifiers, mission_lines
from companion.mission.model import Mission
from rebound_cli.check.ways import Meeting, Way

# A repeat's laps are shown whole up to so many rows; a longer list hides what matters.
_MOST_ROWS = 60


def mission_text(mission: Mission, ways: Sequence[Way]) -> str:
    """For a person."""
    title = f"{mission.name}: {mission.description}" if mission.description else mission.name
    shown = ways if len(ways) <= _MOST_ROWS else ways[: _MOST_ROWS - 1]
    width = max(4, *(len(way.leg.step.label) for way in shown)) + 2
    text_width = max(len(describe_item(way.leg.step.action)) for way in shown) + 1
    head = f"  {'item':<{width + text_width}}{'length':>9}{'time':>9}{'begins':>9}"
    rows = [row for way in shown for row in _rows(way, width, text_width)]
    if len(shown) < len(ways):
        rows.append(f"  ... {len(ways) - len(shown)} more steps")
    # the policies, without the items: those are in the table
    rules = [f"  {line}" for line in mission_lines(mission) if not line.startswith(("Items", " "))]
    return "\n".join([title, "", head, *rows, "", f"  {_total(ways)}", "", *rules])


def _rows(way: Way, width: int, text_width: int) -> list[str]:
    step, leg = way.leg.step, way.leg
    text = describe_item(step.action)
    length = f"{way.length_m:.1f} m" if way.length_m else ""
    begins = "?" if way.begins_s is None else f"{way.begins_s:.1f} s"
    lasts = "?" if leg.lasts_s is None else f"{leg.lasts_s:.1f} s"
    lines = [f"  {step.label:<{width}}{text:<{text_width}}{length:>9}{lasts:>9}{begins:>9}"]
    notes = ["no way round what is known"] if leg.is_cut_off else ["round what is known"] if leg.is_detour else []
    notes += [_meeting(way.meets, way)] if way.meets else []
    notes += [describe_modifiers(step.item)] if describe_modifiers(step.item) else []
    return lines + [f"  {'':<{width + 2}}{note}" for note in notes]


def _meeting(meeting: Meeting, way: Way) -> str:
    north, east, down = way.points_ned_m[meeting.index]
    return f"meets '{meeting.name}' near [{north:.1f}, {east:.1f}, {down:.1f}]"


def _total(ways: Sequence[Way]) -> str:
    length = f"{sum(way.length_m for way in ways):.1f} m"
    if ways[-1].ends_s is None:
        return f"in all {length}; how long depends on how long it waits"
    return f"in all {length} in {ways[-1].ends_s:.0f} s after arming, if nothing is hit"
