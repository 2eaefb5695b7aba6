"""The worst hits of a search, with all that makes them again."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from bench.campaign.plan import Json
from bench.hits.flight import APPROACHES, MOST_RECOVERY_S, begun
from bench.hits.verdicts import FREE_S, PATIENCE_S, velocity_of
from bench.hits.worst import FALL_M, MEETING, NOTICED_M_S, VEHICLE, SearchCase, begun_with
from companion.mission.model import Mission
from rebound_cli.inputs import SimulatedWorld, resolved
from rebound_cli.results.run_folder import RESOLVED_NAME, TRUTH_NAME, FlightRecorder, write_yaml
from rebound_cli.simulation.lockstep import EPOCH_US
from sim_vehicle.shell.truth_file import save_truth

# What a page says of the worst, and of each hit before the numbers that make it.
_MARGIN = """The margin is the factor by which all thresholds of the detector could grow until the hit is missed:
below 1 it is missed."""
_RECOVERY = f"""The worst are falls: over 90°, or {FALL_M:g} m lost. Of two the slower hit is the worse. Then come
vehicles that touch again or do not rest within {MOST_RECOVERY_S:g} s, then the others; of these the later rest is the
worse. Walls that lean over the vehicle, and hits that were missed, do not count."""
_SAID = {
    "margin": (_MARGIN, ("margin", "closing_m_s")),
    "recovery": (_RECOVERY, ("closing_m_s", "latency_ms", "tilt_deg", "lost_m", "again", "rest_s")),
}


def worst(cases: Sequence[SearchCase], results: Mapping[int, Json]) -> Iterator[str]:
    tried = sum(one["flown"] for one in results.values())
    yield f"{tried:,} hits were tried by differential evolution."
    meaning, outcomes = _SAID[cases[0].of]
    yield meaning
    yield f"Hits have {NOTICED_M_S} m/s into the surface at least. The vehicle is the named airframe with the numbers"
    yield f"below; its seed is {cases[0].seed}."
    yield ""
    columns = [results[at] for at in results]
    names = [f"{cases[at].airframe}, {cases[at].imu_hz} Hz" for at in results]
    yield f"| | {' | '.join(names)} |"
    yield "|---" * (len(names) + 1) + "|"
    for key in (*outcomes, *MEETING, *VEHICLE):
        yield f"| {key} | {' | '.join(_text(key, one.get(key)) for one in columns)} |"
    yield ""


def _text(key: str, value: float | None) -> str:
    if value is None:
        return "–"
    return APPROACHES[round(value)] if key == "approach" else f"{value:.6g}"


def keep(case: SearchCase, numbers: Mapping[str, float], folder: Path) -> None:
    """The hit and its recovery as bytes and truth, for `bench corpus judge`. The obstacle is there from the first."""
    approach, scene = begun_with(case, numbers)
    flight = begun(approach.built, approach.case, velocity_of(approach.case.hit), scene, keeps_path=True)
    folder.mkdir(parents=True, exist_ok=True)
    recorder = FlightRecorder(folder)
    try:
        while flight.vehicle.time_boot_us < 1e6 * (FREE_S + PATIENCE_S + MOST_RECOVERY_S):
            result = flight.step()
            recorder.record(EPOCH_US + flight.vehicle.time_boot_us, result)
    finally:
        recorder.close()
    flight.vehicle.note_hit()
    # A replay reads a mission file; of this one only what the vehicle's owner knows counts.
    items = [{"takeoff": {"height_m": 2.0}}, {"land": {}}]
    mission = Mission.model_validate({"name": "hit", "items": items, "companion": approach.built.settings})
    write_yaml(folder / RESOLVED_NAME, resolved(mission, SimulatedWorld(scene, approach.built.airframe)))
    save_truth(folder / TRUTH_NAME, flight.vehicle.truth, EPOCH_US)
