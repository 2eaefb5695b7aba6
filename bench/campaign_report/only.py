"""One mission of a campaign again, with its whole run folder."""

from argparse import Namespace
from pathlib import Path

from bench.random_missions.flight import fly
from bench.random_missions.generator import MissionCase, airframe_data, random_mission
from bench.random_missions.judge import failures
from rebound_cli.results import run_folder

AIRFRAME_AS_GIVEN = "airframe-as-given.yaml"


def run_only(case: MissionCase, out: Path | None) -> int:
    """Fly it as `rebound fly --lockstep` does and say what the campaign makes of it; 0 where it ended as it says."""
    from rebound_cli.main import build_parser

    drawn = random_mission(case)
    folder = run_folder.create_run_folder(out, drawn.data["name"])
    mission = folder / run_folder.MISSION_NAME
    run_folder.write_yaml(folder / AIRFRAME_AS_GIVEN, airframe_data(case))
    sim = drawn.data["sim"] | {"airframe": str(folder / AIRFRAME_AS_GIVEN)}
    run_folder.write_yaml(mission, drawn.data | {"sim": sim})
    options: Namespace = build_parser().parse_args(["fly", str(mission), "--lockstep", "--out", str(folder)])
    options.run(options)
    found = failures(fly(case, drawn))
    print("\nended as the mission says" if not found else "\nnot as the mission says:")
    for failure in found:
        print(f"  {failure.cause}: {failure.details}")
    return 1 if found else 0
