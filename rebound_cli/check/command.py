"""`rebound check`: every file in turn; one that is wrong does not keep the others from being looked at."""

import json
import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path

from companion.errors import ConfigurationError, ReboundError
from companion.flight.plan import describe_item, describe_modifiers, mission_lines
from companion.mission.model import Mission
from rebound_cli.check.legs import FlownLeg, flown_legs
from rebound_cli.check.schema import mission_schema
from rebound_cli.inputs.inputs import load_mission_document, mission_from, world_from
from rebound_cli.simulation.compiling import stand_own
from sim_vehicle.errors import SimulationError

# A repeat's laps are shown whole up to so many rows; a longer list hides what matters.
_MOST_ROWS = 60


def run_check(options: Namespace) -> int:
    """0 when every mission can be flown as it is written."""
    if options.schema:
        print(json.dumps(mission_schema(), indent=2))
        return 0
    if not options.missions:
        raise ConfigurationError("give one mission file or more, such as missions/wall.yaml, or --schema.")
    wrong, pages = 0, dict[Path, Path]()
    for number, path in enumerate(options.missions):
        print("\n" if number else "", end="")
        try:
            _check(path, options, pages)
        except (ReboundError, SimulationError) as error:
            print(f"rebound: {error}", file=sys.stderr)
            wrong += 1
    return 1 if wrong else 0


def _check(path: Path, options: Namespace, pages: dict[Path, Path]) -> None:
    """`pages`: those written so far, each with its mission."""
    document = load_mission_document(path, options.set, options.airframe)
    world = world_from(document)
    stand_own(world)
    mission = mission_from(document, world)
    legs = flown_legs(mission, world)
    print(mission_text(mission, legs))
    if options.no_picture:
        return
    # A drone that checks its mission before each flight loads no page.
    from rebound_cli.check.page import write_mission_page

    page = options.out / f"{mission.name}.html"
    if pages.setdefault(page, path) != path:
        raise ConfigurationError(f"{path} has the name of {pages[page]}, {mission.name!r}: {page} shows that one.")
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        write_mission_page(page, mission, world, legs)
    except OSError as error:
        raise ConfigurationError(f"{page} cannot be written: {error.strerror}.") from error
    print(f"\ndrawn in {page}")


def mission_text(mission: Mission, legs: Sequence[FlownLeg]) -> str:
    """A table: what, how far, how long, and what stands in the way."""
    title = f"{mission.name}: {mission.description}" if mission.description else mission.name
    shown = legs if len(legs) <= _MOST_ROWS else legs[: _MOST_ROWS - 1]
    width = max(4, *(len(flown.leg.step.label) for flown in shown)) + 2
    text_width = max(len(describe_item(flown.leg.step.action)) for flown in shown) + 1
    rows = [f"  {'item':<{width + text_width}}{'length':>9}{'time':>9}{'begins':>9}"]
    for flown in shown:
        step, leg = flown.leg.step, flown.leg
        length = f"{flown.length_m:.1f} m" if flown.length_m else ""
        text = f"{step.label:<{width}}{describe_item(step.action):<{text_width}}"
        rows.append(f"  {text}{length:>9}{_time(leg.lasts_s):>9}{_time(flown.begins_s):>9}")
        rows += [f"  {'':<{width + 2}}{note}" for note in _notes(flown)]
    if len(shown) < len(legs):
        rows.append(f"  ... {len(legs) - len(shown)} more steps")
    total = f"in all {sum(flown.length_m for flown in legs):.1f} m"
    lasts_s = legs[-1].ends_s
    known = "; how long depends on how long it waits"
    known = known if lasts_s is None else f" in {lasts_s:.0f} s after arming, if nothing is hit"
    # the policies, without the items: those are in the table
    rules = [f"  {line}" for line in mission_lines(mission) if not line.startswith(("Items", " "))]
    return "\n".join([title, "", *rows, "", f"  {total}{known}", "", *rules])


def _time(seconds: float | None) -> str:
    return "?" if seconds is None else f"{seconds:.1f} s"


def _notes(flown: FlownLeg) -> Iterator[str]:
    if flown.leg.trajectory is None or flown.leg.is_detour:
        yield "no way round what is known" if flown.leg.trajectory is None else "round what is known"
    if flown.meets is not None:
        north, east, down = flown.points_ned_m[flown.meets.index]
        meets = "may meet" if flown.meets.moves else "meets"
        yield f"{meets} '{flown.meets.name}' near [{north:.1f}, {east:.1f}, {down:.1f}]"
    if modifiers := describe_modifiers(flown.leg.step.item):
        yield modifiers
