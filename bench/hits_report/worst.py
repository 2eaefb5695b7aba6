"""The hits nearest to being missed, with all that makes them again."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from bench.campaign.plan import Json
from bench.detectors.hits import FOLLOWED_S
from bench.hits.flight import APPROACHES, begun
from bench.hits.verdicts import FREE_S, PATIENCE_S, velocity_of
from bench.hits.worst import MEETING, NOTICED_M_S, VEHICLE, SearchCase, begun_with
from companion.mission.model import Mission
from rebound_cli.inputs import SimulatedWorld, resolved
from rebound_cli.results.run_folder import RESOLVED_NAME, TRUTH_NAME, FlightRecorder, write_yaml
from rebound_cli.simulation.lockstep import EPOCH_US
from sim_vehicle.shell.truth_file import save_truth


def worst(cases: Sequence[SearchCase], results: Mapping[int, Json]) -> Iterator[str]:
    tried = sum(one["flown"] for one in results.values())
    yield f"{tried:,} hits were tried by differential evolution. The margin is the factor by which all thresholds of"
    yield f"the detector could grow until the hit is missed: below 1 it is missed. Hits have {NOTICED_M_S} m/s into"
    yield "the surface at least. The vehicle is the named airframe with the numbers below."
    yield ""
    columns = [results[at] for at in results]
    names = [f"{cases[at].airframe}, {cases[at].imu_hz} Hz" for at in results]
    yield f"| | {' | '.join(names)} |"
    yield "|---" * (len(names) + 1) + "|"
    for key in ("margin", "closing_m_s", *MEETING, *VEHICLE):
        texts = [APPROACHES[round(one[key])] if key == "approach" else f"{one[key]:.6g}" for one in columns]
        yield f"| {key} | {' | '.join(texts)} |"
    yield ""


def keep(case: SearchCase, numbers: Mapping[str, float], folder: Path) -> None:
    """The hit's flight as bytes and truth, for `bench corpus judge`. It has the obstacle before it from the first."""
    approach, scene = begun_with(case, numbers)
    flight = begun(approach.built, approach.case, velocity_of(approach.case.hit), scene, keeps_path=True)
    folder.mkdir(parents=True, exist_ok=True)
    recorder = FlightRecorder(folder)
    try:
        while flight.vehicle.time_boot_us < 1e6 * (FREE_S + PATIENCE_S + FOLLOWED_S):
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
