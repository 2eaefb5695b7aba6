"""A mission as the report's page, before it is flown: its way in the simulated world, when nothing is hit."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from companion.flight.plan import describe_item
from companion.messages import LocalPosition, Vector3
from companion.mission.model import Mission
from companion.shell.files import write_whole
from rebound_cli.check.legs import FlownLeg
from rebound_cli.inputs.inputs import SimulatedWorld
from rebound_cli.replay.watching import Findings
from rebound_cli.report.content import UNFLOWN, content
from rebound_cli.report.page import SCRIPTS, assembled
from rebound_cli.report.scene import rounded_s
from rebound_cli.report.shown_flight import ShownFlight
from rebound_cli.results.flight_log import flight_log_of
from rebound_cli.results.truth_match import FlightTruth

# A wait whose end nobody knows is drawn this long.
_UNKNOWN_S = 5.0


def write_mission_page(path: Path, mission: Mission, world: SimulatedWorld, legs: Sequence[FlownLeg]) -> None:
    """Raises OSError."""
    flight = planned_flight(mission, world, legs)
    items = [(rounded_s(flight, event["time_us"]), event["text"]) for event in flight.events if event["kind"] == "item"]
    told = {"sentence": f"Mission '{mission.name}', when nothing is hit", "lines": [mission.description]}
    shown = {"headings": {"h-replay": "The way", "h-events": "What would happen"}, "modes": items}
    write_whole(path, assembled(content(flight) | UNFLOWN | told | shown, SCRIPTS).encode())


def planned_flight(mission: Mission, world: SimulatedWorld, legs: Sequence[FlownLeg]) -> ShownFlight:
    """As if the vehicle booted while it is armed: with that begins what moves in its world."""
    (north_m, east_m, _), standing_m = world.scene.start.position_ned_m, world.airframe.geometry.foot_depth_m
    # Later than all that was known beforehand.
    started_us = at_us = 1 + max((patch.found_at_us for patch in mission.obstacles.known), default=0)
    events = [_event(at_us, "armed", "armed", origin_ned_m=(north_m, east_m, -standing_m))]
    samples: list[tuple[int, LocalPosition]] = []

    def add(at_s: float, place_ned_m: Sequence[float], velocity_ned_m_s: Vector3) -> None:
        north, east, down = place_ned_m
        place = (north + north_m, east + east_m, down - standing_m)
        samples.append((at_us + round(at_s * 1e6), LocalPosition(0, place, velocity_ned_m_s)))

    for flown in legs:
        step, trajectory = flown.leg.step, flown.leg.trajectory
        events.append(_event(at_us, "item", f"{step.label} {describe_item(step.action)}"))
        times_s = flown.fractions * (0.0 if trajectory is None else trajectory.duration_s)
        for at_s, place in zip(times_s.tolist(), flown.points_ned_m.tolist(), strict=True):
            add(at_s, place, (0.0, 0.0, 0.0) if trajectory is None else trajectory.at(at_s)[1])
        if flown.meets is not None:
            met_us = at_us + round(times_s[flown.meets.index] * 1e6)
            events.append(_event(met_us, "meets", flown.meets.name))
        north, east, down = flown.points_ned_m[-1].tolist()
        lasts_s = _UNKNOWN_S if flown.leg.lasts_s is None else flown.leg.lasts_s
        add(lasts_s, (north, east, 0.0 if step.item.name in ("land", "return") else down), (0.0, 0.0, 0.0))
        at_us += round(lasts_s * 1e6)
    return ShownFlight(
        name=mission.name,
        started_at_us=started_us,
        log=flight_log_of(samples),
        config=mission.companion,
        findings=Findings(),
        events=events,
        scene=world.scene,
        rotors_frd_m=[rotor.place_frd_m for rotor in world.airframe.rotors],
        truth=FlightTruth((), {}, started_us),
        patches=mission.obstacles.known,
    )


def _event(at_us: int, kind: str, text: str, **data: Any) -> dict[str, Any]:
    return {"time_us": at_us, "kind": kind, "text": text, "data": data}
