"""A recorded flight with all that the report shows of it, from its folder or from any log that was replayed."""

import json
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from companion.errors import ReboundError
from companion.guard.config import GuardConfig
from companion.memory.patch import Patch
from companion.mission.config import CompanionConfig
from companion.mission.model import Mission
from rebound_cli.inputs.documents import load_document, validated
from rebound_cli.replay.recording import Recording, read_recording, read_settings, reproduce, settings_file
from rebound_cli.replay.report import Replay
from rebound_cli.replay.watching import Finding, Findings, sampled_as
from rebound_cli.results import run_folder
from rebound_cli.results.flight_log import FlightLog, flight_log_of, read_flight_log
from rebound_cli.results.truth_match import FlightTruth, Time, read_truth
from sim_vehicle.scene import Scene

if TYPE_CHECKING:
    from sim_vehicle.truth import Hit


@dataclass(frozen=True, slots=True)
class ShownFlight:
    """Times are the log's own clock; positions the vehicle's local NED.

    `events` are as `events.jsonl` has them. None stands for what there is none of.
    """

    name: str
    started_at_us: int
    log: FlightLog
    config: CompanionConfig
    findings: Findings
    events: Sequence[Mapping[str, Any]]
    summary: Mapping[str, Any] | None = None
    scene: Scene | None = None
    rotors_frd_m: Sequence[tuple[float, float]] = ()  # of a simulated vehicle with a list of them
    stop_s: float | None = None  # contact time of a simulated vehicle's frame or of its arms' stop
    truth: FlightTruth | None = None
    patches: Sequence[Patch] = ()
    versions: Mapping[str, str] | None = None
    difference: str | None = None  # from what was recorded, where it was decided again and not to the same

    @property
    def origin_ned_m(self) -> tuple[float, float, float]:
        """Where it was armed: the zero of the mission, and of what is remembered."""
        armed = next((event for event in self.events if event["kind"] == "armed"), None)
        with run_folder.reading(run_folder.EVENTS_NAME):
            north, east, down = (armed or {}).get("data", {}).get("origin_ned_m") or (0.0, 0.0, 0.0)
            return (float(north), float(east), float(down))

    @property
    def hits(self) -> Sequence[Finding]:
        """Collisions, without those that nothing else bore out."""
        return [hit for hit in self.findings.collisions if self.taken_back_us(hit) is None]

    def taken_back_us(self, hit: Finding) -> float | None:
        """When it was found to be none."""
        after = (other.at_us for other in self.findings.impacts if other.at_us > hit.at_us)
        until_us = min(after, default=math.inf)
        times = (float(event["time_us"]) for event in self.events if event["kind"] == "unconfirmed")
        return next((at_us for at_us in times if hit.at_us < at_us <= until_us), None)

    def contact_of(self, finding: Finding) -> "Hit | None":
        """The simulator's contact that an impact belongs to: of several hits in one, the first's, as in summaries."""
        if self.truth is None:
            return None
        indices = [self.truth.index_of_hit(one.first.impact.sample_time_boot_us) for one in (finding, *self.hits)]
        same = [hit for hit, index in zip(self.hits, indices[1:], strict=True) if index == indices[0]]
        return None if indices[0] is None or finding in same[1:] else self.truth.hits[indices[0]]

    def seconds(self, at_us: Time) -> Time:
        """Since the flight began, of one time or of many."""
        return (at_us - self.started_at_us) * 1e-6

    @property
    def ended_s(self) -> float:
        times = (self.log.imu_at_us, self.log.position_at_us, self.log.setpoint_at_us)
        return max((self.seconds(float(at_us[-1])) for at_us in times if len(at_us)), default=0.0)


def recorded_flight(folder: Path) -> ShownFlight:
    """Of a run's folder: what was recorded, decided again for all that the detector thought. Raises ReboundError."""
    recording = read_recording(folder)
    return decided_again(folder, recording, *reproduce(recording))


def decided_again(folder: Path, recording: Recording, findings: Findings, difference: str | None) -> ShownFlight:
    """The same where that was done already. Raises ReboundError."""
    return replace(
        _in_folder(folder, recording.settings, findings, "".join(recording.event_lines)),
        started_at_us=recording.steps[0].time_us,
        log=read_flight_log(folder / run_folder.TLOG_NAME),
        versions=recording.versions,
        difference=difference,
    )


def unseen_flight(folder: Path) -> ShownFlight:
    """One that is still flown: what is known of it beforehand. Raises ReboundError."""
    return _in_folder(folder, read_settings(folder), Findings(), "")


def _in_folder(folder: Path, settings: Mission | GuardConfig, findings: Findings, event_lines: str) -> ShownFlight:
    """All but the log."""
    summary = run_folder.read_summary(folder)
    return ShownFlight(
        name=str((summary or {}).get("mission", folder.resolve().name)),
        started_at_us=0,
        log=flight_log_of(()),
        config=settings.companion,
        findings=findings,
        events=list(run_folder.read_records(folder / run_folder.EVENTS_NAME, event_lines)),
        summary=summary,
        **_world(folder),
        truth=read_truth(folder / run_folder.TRUTH_NAME),
        patches=_patches(folder / run_folder.OBSTACLES_NAME),
    )


def replayed_flight(replay: Replay) -> ShownFlight:
    """Of any log: what it holds and what was found in it."""
    log, told = replay.log, replay.findings.happenings
    return ShownFlight(
        name=log.path.name,
        started_at_us=log.started_at_us,
        log=flight_log_of(log.heard),
        config=sampled_as(log, replay.config),
        findings=replay.findings,
        events=[{"time_us": at_us, "kind": _kind(text), "text": text, "data": {}} for at_us, text in told],
    )


def _kind(text: str) -> str:
    """Of a line of a foreign log's timeline."""
    return "mode" if text.startswith("mode ") else text if text in ("armed", "disarmed", "landed", "took off") else ""


def _world(folder: Path) -> dict[str, Any]:
    """Scene, rotors and stop, where the vehicle was a simulated one."""
    airframe = folder / run_folder.AIRFRAME_NAME
    if not airframe.exists():
        return {}
    document = load_document(settings_file(folder))
    scene = validated(Scene, document, document.data.get("sim") or {}, ("sim",))
    try:
        with run_folder.reading(airframe):
            flown = load_document(airframe).data
            places = [tuple(rotor["place_frd_m"]) for rotor in flown.get("rotors") or ()]
            return {"scene": scene, "rotors_frd_m": places, "stop_s": flown["arms"]["stop"]["contact_time_s"]}
    except ReboundError as error:
        # It draws the vehicle, and decides nothing.
        warnings.warn(f"{str(error).rstrip('.')}; the flight is shown without it", stacklevel=1)
        return {"scene": scene}


def _patches(path: Path) -> Sequence[Patch]:
    """What was remembered at the end; nothing where nothing was."""
    if not path.exists():
        return ()
    with run_folder.reading(path):
        return [Patch.model_validate(data) for data in json.loads(path.read_text())["patches"]]
