"""`rebound check`: every file in turn; one that is wrong does not keep the others from being looked at."""

import json
import sys
from argparse import Namespace
from pathlib import Path

from companion.errors import ConfigurationError, ReboundError
from rebound_cli.check.schema import mission_schema
from rebound_cli.check.table import mission_text
from rebound_cli.check.ways import planned_ways
from rebound_cli.extras import needed_text
from rebound_cli.inputs import load_mission_document, mission_from, world_from
from sim_vehicle.errors import SimulationError


def run_check(options: Namespace) -> int:
    """0 when every mission can be flown as it is written."""
    if options.schema:
        print(json.dumps(mission_schema(), indent=2))
        return 0
    if not options.missions:
        raise ConfigurationError("give one mission file or more, such as missions/wall.yaml, or --schema.")
    wrong = 0
    for number, path in enumerate(options.missions):
        print("\n" if number else "", end="")
        try:
            _check(path, options)
        except (ReboundError, SimulationError) as error:
            print(f"rebound: {error}", file=sys.stderr)
            wrong += 1
    return 1 if wrong else 0


def _check(path: Path, options: Namespace) -> None:
    document = load_mission_document(path, options.set)
    world = world_from(document)
    mission = mission_from(document, world)
    ways = planned_ways(mission, world)
    print(mission_text(mission, ways))
    if options.no_picture:
        return
    try:
        # A drone has no matplotlib, and need not have.
        from rebound_cli.check.picture import draw_mission
    except ModuleNotFoundError as error:
        print(f"\nnot drawn: {needed_text(error)}")
        return
    picture = options.out / f"{mission.name}.png"
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        draw_mission(picture, mission, world.scene, ways)
    except OSError as error:
        raise ConfigurationError(f"{picture} cannot be written: {error.strerror}.") from error
    print(f"\ndrawn in {picture}")
