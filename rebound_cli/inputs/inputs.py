"""From a mission file and the command line's options to validated models."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from companion.errors import ConfigurationError
from companion.motion.vector import ZERO, plus
from rebound_cli.inputs import documents
from rebound_cli.inputs.documents import Document, DocumentError, DocumentPath, load_document, validated
from rebound_cli.inputs.shipped import shipped_missions
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import HIT_KINDS, RESOLVED_NAME, read_records, read_text, reading, whole_lines
from sim_vehicle.errors import SimulationError

if TYPE_CHECKING:
    from companion.mission.config import CompanionConfig
    from companion.mission.model import Mission
    from sim_vehicle.airframe import Airframe
    from sim_vehicle.scene import Scene


@dataclass(frozen=True, slots=True)
class SimulatedWorld:
    scene: "Scene"
    airframe: "Airframe"


def load_mission_document(
    path: Path, sets: Sequence[str], airframe: str | None = None, seed: int | None = None, companion: Path | None = None
) -> Document:
    """The mission file with every option put in, and the `companion:` part of that file. Raises DocumentError."""
    from companion.mission.config import CompanionConfig

    document = load_document(path, shipped_missions())
    if companion is not None:
        settings = _with_companion(companion)
        validated(CompanionConfig, settings, settings.data["companion"] or {}, ("companion",))
        document.data["companion"] = settings.data["companion"] or {}
    _apply_options(document, sets, airframe, seed)
    return document


def companion_settings(path: Path | None, sets: Sequence[str] = ()) -> "CompanionConfig":
    """The companion's for a replay: defaults, a file's, and what the command line changes. Raises DocumentError.

    Of the file only the `companion:` part counts.
    """
    from companion.mission.config import CompanionConfig

    document = _with_companion(path) if path is not None else Document("no mission file")
    documents.apply_overrides(document, sets, "companion")
    return validated(CompanionConfig, document, document.data.get("companion") or {}, ("companion",))


def _with_companion(path: Path) -> Document:
    document = load_document(path)
    if "companion" not in document.data:
        raise DocumentError(f"{path}: has no companion: part; write the settings below it.")
    return document


def _apply_options(document: Document, sets: Sequence[str], airframe: str | None, seed: int | None) -> None:
    documents.apply_overrides(document, sets)
    for option, value in (("airframe", airframe), ("seed", seed)):
        if value is not None:
            document.put_option(f"--{option}", ("sim", option), value)


# A mission's models take a fifth of a simulated vehicle's start: imported where there is a mission.
def mission_from(document: Document, world: SimulatedWorld | None = None) -> "Mission":
    """Flown by `world`, if simulated. Raises DocumentError, also for a file of obstacles that cannot be read."""
    from companion.mission.model import Mission

    read_obstacles(document)
    data = document.data if world is None else with_guards(document.data, world.airframe)
    return validated(Mission, document, data)


def with_guards(data: Mapping[str, Any], airframe: "Airframe") -> Mapping[str, Any]:
    """A mission, with the airframe's guards where it names none of its own."""
    companion = data.get("companion", {})
    estimate = companion.get("estimate", {}) if isinstance(companion, dict) else None
    if not isinstance(estimate, dict) or "guards" in estimate:
        return data
    return {**data, "companion": {**companion, "estimate": {**estimate, "guards": guards_of(airframe)}}}


def guards_of(airframe: "Airframe") -> dict[str, Any]:
    """What its owner writes into `companion.estimate.guards`, from a ruler: to a tenth of a millimetre."""
    frame = airframe.geometry
    centre_m = round(frame.motor_radius_m, 4)
    return {"centre_m": centre_m, "radius_m": frame.guard_radius_m, "height_m": frame.guard_height_m}


def read_obstacles(document: Document) -> None:
    """Put what the mission's `obstacles.file` holds in its place; with that a mission is whole without the file."""
    from companion.memory.stored import ObstacleFile

    obstacles: Any = document.data.get("obstacles")
    file, known = (obstacles.get("file"), obstacles.get("known", [])) if isinstance(obstacles, dict) else (None, None)
    if not isinstance(file, str) or not isinstance(known, list) or not file:
        return
    given = document.override_of(("obstacles", "file"))
    folder = Path(document.name).parent if given is None else Path()
    try:
        stored = load_document(folder / file)
    except DocumentError as error:
        raise DocumentError(f"{document.place_of(('obstacles', 'file'))}: {error}") from error
    validated(ObstacleFile, stored, stored.data)
    known = [*known, *stored.data["patches"]]
    document.data["obstacles"] = {key: value for key, value in obstacles.items() if key != "file"} | {"known": known}


def world_from(document: Document) -> SimulatedWorld:
    """The `sim:` part and its airframe. Raises DocumentError, also for a wall through the start position."""
    # A drone loads nothing of the simulation.
    from sim_vehicle.faults.spec import check_motor
    from sim_vehicle.mavlink.faulty_link import check_messages
    from sim_vehicle.scene import Scene, check_start_is_free, check_wind_can_be_held

    scene = validated(Scene, document, document.data.get("sim") or {}, ("sim",))
    with _at(document, "airframe"):
        airframe = _load_airframe(scene.airframe)
    for number, fault in enumerate(scene.faults):
        with _at(document, "faults", number, "messages"):
            check_messages(fault)
        with _at(document, "faults", number, "motor"):
            check_motor(fault, airframe.rotor_count)
    with _at(document, "walls"):
        check_start_is_free(scene, airframe)
    with _at(document, "wind_ned_m_s"):
        check_wind_can_be_held(scene, airframe)
    return SimulatedWorld(scene, airframe)


@contextmanager
def _at(document: Document, *path: str | int) -> Iterator[None]:
    """What the simulator refuses of `sim:` carries its place. Raises DocumentError."""
    try:
        yield
    except SimulationError as error:
        sentence = str(error) if str(error).endswith((".", "!", "?")) else f"{error}."
        raise DocumentError(f"{document.place_of(('sim', *path))}: {sentence}") from error


def load_world(path: Path | None, sets: Sequence[str], airframe: str | None, seed: int | None) -> SimulatedWorld:
    """For the simulated vehicle alone: of the mission file, if there is one, only the `sim:` part counts."""
    document = Document("no mission file") if path is None else load_document(path, shipped_missions())
    documents.apply_overrides(document, sets, "sim")
    _apply_options(document, (), airframe, seed)
    return world_from(document)


def _load_airframe(name: str) -> "Airframe":
    """A built-in airframe by name, or one from a file when the name looks like a path."""
    from sim_vehicle.airframe import Airframe, built_in_airframes, load_built_in, with_base

    if "/" not in name and not name.endswith((".yaml", ".yml")):
        return load_built_in(name)
    own = load_document(Path(name), built_in_airframes())
    missing = [key for key, field in Airframe.model_fields.items() if field.is_required() and key not in own.data]
    if "based_on" not in own.data and missing:
        known = ", ".join(built_in_airframes())
        raise DocumentError(f"{name}:1: add based_on with one of {known}; else write out {', '.join(missing)}, too.")
    airframe = validated(Airframe, own, with_base(own.data))
    most_kg_m2 = airframe.mass_kg * airframe.geometry.reach_m**2
    if max(airframe.inertia_kg_m2) > most_kg_m2:
        place, text = own.place_of(("inertia_kg_m2",)), f"all mass at the rim would have {most_kg_m2:.3g}"
        raise DocumentError(f"{place}: inertia_kg_m2: {text}; are these g m^2?")
    return airframe


def resolved(mission: "Mission", world: SimulatedWorld | None) -> dict[str, Any]:
    """The mission with every default and option written out; it is itself a mission file."""
    data = mission.model_dump(mode="json", exclude_none=True, by_alias=True)
    if world is not None:
        data["sim"] = world.scene.model_dump(mode="json", exclude_none=True)
    return data


def resume_of(run: Path, mission: "Mission") -> dict[str, Any]:
    """The mission's `resume:` part, of a flight that ended early or was killed. Raises ConfigurationError."""
    flown = mission_from(load_document(run / RESOLVED_NAME))
    if flown.items != mission.items:
        raise ConfigurationError(f"{run} is not a flight of this mission: its items are others.")
    events = list(read_records(run / run_folder.EVENTS_NAME, whole_lines(read_text(run / run_folder.EVENTS_NAME))))
    armed = _last(events, "armed")
    item, end = _last(events, "item"), _last(events, "aborted")
    if _last(events, "done") is not None:
        raise ConfigurationError(f"{run} was flown to its end: there is nothing to resume.")
    if armed is None or item is None:
        raise ConfigurationError(f"{run} ended before its first item: fly it from the start.")
    with reading(run / run_folder.EVENTS_NAME):
        # In the vehicle's frame, which has moved by the resets of its estimator since.
        since = events[events.index(armed) :]
        shifts = [each["data"]["shift_ned_m"] for each in since if "shift_ned_m" in each["data"]]
        at_step = int((end or item)["data"].get("next_step", item["data"]["step"]))
        return {
            "at_step": max(1, at_step),
            "origin_ned_m": plus(armed["data"]["origin_ned_m"], 1.0, shifts[-1] if shifts else ZERO),
            "armed_at_us": armed["time_us"],
            "armed_boot_us": armed["data"]["time_boot_us"],
            "hits": sum(HIT_KINDS.get(each["kind"], 0) for each in events) + (flown.resume.hits if flown.resume else 0),
        }


def resume(document: Document, run: Path, mission: "Mission", knows_more: bool) -> None:
    """Go on where that flight was interrupted, and if it `knows_more` with its obstacles. Raises ConfigurationError."""
    stored = run / run_folder.OBSTACLES_NAME
    given: dict[DocumentPath, Any] = {("resume",): resume_of(run, mission)}
    if knows_more and stored.exists():
        given |= {("obstacles", "known"): [], ("obstacles", "file"): str(stored)}
    for path, value in given.items():
        document.put_option("--resume", path, value, run)


def _last(events: Sequence[dict[str, Any]], kind: str) -> dict[str, Any] | None:
    return next((event for event in reversed(events) if event["kind"] == kind), None)
