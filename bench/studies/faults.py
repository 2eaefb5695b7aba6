"""`bench faults`: every fault and attack by the dozen, and the table of what became of them."""

import math
import tempfile
from argparse import Namespace
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from bench.faults.catalogue import FLOWN, GROUPS
from bench.fly.air import ENDS, FAILED, HANDED_OVER, KILLED, Fault
from bench.fly.campaign import Json, Results
from bench.fly.faulted import FaultedFlight
from bench.fly.lockstep import NOTICED_M_S, STANDS_M, JudgedFlight
from bench.rows.contacts import crashes, first_touch, heights_m, tilts_deg
from bench.rows.tables import table
from bench.studies.study import Shown, run_study
from companion.errors import ConfigurationError
from companion.shell.tlog import read_tlog
from rebound_cli.replay.recording import read_recording, reproduce
from rebound_cli.results import run_folder
from rebound_cli.results.truth_match import FlightTruth
from rebound_cli.simulation.lockstep import EPOCH_US
from sim_vehicle.truth import Hit

# From the touch to the event: a contact of 0.12 s, the slowest stream's 50 ms, and a link that holds packets back.
FOUND_WITHIN_S = 0.5
# A bounce of the same touch.
SAME_TOUCH_S = 0.25
# A flight decided again costs as much as flown: only the first of each row is.
DECIDED_AGAIN = 1
CLIPPED_PART = 0.001
GROUP_OF = {fault.name: group for group, faults in GROUPS.items() for fault in faults}
_SHOWN = 3


@dataclass(frozen=True, slots=True)
class FaultCase:
    """One flight of the fault of that name; everything else is drawn from the seed."""

    seed: int
    fault: str


def run_faults(options: Namespace) -> int:
    """0 when every row did what is expected of it."""
    names = [*FLOWN] if options.only is None else [options.only]
    if options.only not in (None, *FLOWN):
        raise ConfigurationError(f"--only {options.only}: there is no such fault; there are {', '.join(FLOWN)}.")
    cases = [FaultCase(seed, name) for seed in range(options.seeds) for name in names]
    return run_study(options, "faults", "Faults and attacks", cases, work_out_fault, shown)


# --- one flight, by the truth


def work_out_fault(case: FaultCase) -> Json:
    return flown_with(FLOWN[case.fault], case.seed)


def flown_with(fault: Fault, seed: int) -> Json:
    with tempfile.TemporaryDirectory() as folder:
        flight = FaultedFlight(seed, fault, Path(folder))
        flight.fly()
        return judged(flight)


def judged(flight: FaultedFlight) -> Json:
    flown, expected = _flown(flight), flight.fault.expected
    touches = [hit for hit in flown.truth.hits if hit.closing_speed_m_s >= 0.0]
    told_s = [at for at, event in zip(flight.recorder.told_s, flown.events, strict=True) if event.kind == "detection"]
    first = next((hit for hit in touches if hit.closing_speed_m_s >= NOTICED_M_S), None)
    blind_until_us = _blind_until_us(flight, first)
    unseen = blind_until_us is not None
    if first is not None and blind_until_us is not None:
        touches.append(replace(first, ended_at_boot_us=max(first.ended_at_boot_us, blind_until_us)))
    is_found = first is not None and any(_is_of(first, at_s) for at_s in told_s)
    is_up = heights_m(flown) > STANDS_M
    beside = [at for at in told_s if not any(_is_of(hit, at) for hit in touches) and is_up[flown.row_at(at * 1e6)]]
    counted_false = max(0, len(beside) - flown.report.unconfirmed)
    outcome = flight.ended or flown.report.outcome
    after_us = math.inf if first is None else first.ended_at_boot_us + SAME_TOUCH_S * 1e6
    again = [hit.closing_speed_m_s for hit in touches if hit.contact_at_boot_us > after_us]
    air = flight.air
    # A landing that PX4 or a pilot flies may come at any time.
    excused = ("touched the ground",) if air.has_left_offboard else ()
    complaints = [f"{cause}: {details}" for cause, details in crashes(flown) if cause not in excused and not unseen]
    complaints += [f"setpoint outside: {air.outside[0]}"] if air.outside else []
    complaints += [f"{air.after_told} setpoints or commands after the pilot was heard"] if air.after_told else []
    complaints += ["the pilot was overruled"] if air.is_overruled else []
    complaints += _log(flight)
    outcomes = (*expected.outcomes, HANDED_OVER) if unseen else expected.outcomes
    complaints += [f"{outcome}: {flown.report.reason}"] if outcome not in outcomes else []
    complaints += ["hit not found"] if expected.finds and first is not None and not is_found else []
    complaints += [f"{counted_false} false hits counted"] if counted_false > expected.false_hits else []
    if flight.fault_text and FAILED not in expected.outcomes:
        complaints.append(flight.fault_text)
    return {
        "complaints": complaints,
        "outcome": outcome,
        "hit": first is not None,
        "found": is_found,
        "unseen": unseen,
        "false": counted_false,
        "unconfirmed": flown.report.unconfirmed,
        "tilt_deg": round(float(tilts_deg(flown.truth.series["attitude_wxyz"]).max()), 1),
        "ground_m_s": _ground_m_s(flown),
        "again_m_s": round(max(again, default=0.0), 2),
        "after_told": flight.air.after_told,
    }


def _blind_until_us(flight: FaultedFlight, hit: Hit | None) -> float | None:
    """When the fault's end lets a hit be seen that it hid; None for one that it did not hide."""
    if hit is None or not flight.fault.expected.blinds:
        return None
    when = flight.injector.when
    return 1e6 * when.ended_s(flight.air) if when.is_on(flight.air, 1e-6 * hit.contact_at_boot_us) else None


def _flown(flight: FaultedFlight) -> JudgedFlight:
    truth = flight.air.vehicle.truth
    # By the vehicle's clock, whatever the companion's showed.
    events = [
        replace(event, time_us=round(EPOCH_US + at_s * 1e6))
        for event, at_s in zip(flight.recorder.events, flight.recorder.told_s, strict=True)
    ]
    known = FlightTruth(truth.hits, truth.series(), EPOCH_US)
    return JudgedFlight(flight.mission, flight.companion.report(), events, known, flight.scene, flight.airframe)


def _log(flight: FaultedFlight) -> list[str]:
    """Whether the log can be read, is whole, and is decided again to the bit."""
    events = (flight.recorder.folder / run_folder.EVENTS_NAME).read_text(encoding="utf-8").splitlines()
    if len(events) != len(flight.recorder.events):
        return [f"log lost: {len(flight.recorder.events) - len(events)} events"]
    stamps = [stamp for stamp, _ in read_tlog(flight.recorder.folder / run_folder.TLOG_NAME)]
    if flight.ended == KILLED:
        # TlogWriter hands on twice a second.
        late_s = flight.killed_at_s - (stamps[-1] - EPOCH_US) * 1e-6
        return [f"log lost: the last {late_s:.1f} s"] if late_s > 0.6 else []
    # Noise that looks like a header may hide the packet after it from who reads the file.
    if abs(len(stamps) - flight.recorder.counted) > flight.recorder.counted * CLIPPED_PART:
        return [f"log lost: {flight.recorder.counted - len(stamps)} of {flight.recorder.counted} packets"]
    # A fault inside the program is in no log.
    is_reproducible = not flight.fault_text and not any(event.kind == "fault" for event in flight.recorder.events)
    if flight.number < DECIDED_AGAIN and is_reproducible:
        _, difference = reproduce(read_recording(flight.recorder.folder))
        return [] if difference is None else [f"decided otherwise from the log: {difference}"]
    return []


def _ground_m_s(flown: JudgedFlight) -> float | None:
    """Speed down at the first touch of the ground; None where it stays up."""
    row = first_touch(heights_m(flown), STANDS_M)
    return None if row is None else round(float(flown.truth.series["velocity_ned_m_s"][row, 2]), 2)


def _is_of(hit: Hit, at_s: float) -> bool:
    return at_s - 1e-6 * hit.contact_at_boot_us >= 0.0 and at_s - 1e-6 * hit.ended_at_boot_us <= FOUND_WITHIN_S


# --- all of them


def shown(results: Results) -> Shown:
    # The faults in the table's order.
    order = [*FLOWN].index
    rows = pd.DataFrame(results.rows()).sort_values("fault", key=lambda names: names.map(order), kind="stable")
    failing = list(rows[rows["complaints"].map(bool)]["fault"].unique())
    lead = f"{rows['fault'].nunique()} faults, {len(rows)} flights; {len(failing)} rows not as expected."
    told = table([_of_fault(str(name), flights) for name, flights in rows.groupby("fault", sort=False)])
    parts = {"": f"{lead}\n\n{told}", "What was not as expected": complaints(rows)}
    return Shown(parts, f"{lead} {', '.join(failing)}", rows, is_met=not failing)


def _of_fault(name: str, flights: pd.DataFrame) -> dict[str, object]:
    """What is injected, expected and happened, the worst of it, and the verdict."""
    bad = int(flights["complaints"].map(bool).sum())
    hits = flights[flights["hit"]]
    ends = flights["outcome"].map(ENDS).value_counts(sort=False)
    happened = ", ".join(f"{end} {count}" for end, count in ends.items())
    happened += f"; hits found {hits['found'].sum()} of {len(hits)}"
    for column, words in (
        ("unseen", "of them met unseen"),
        ("false", "counted for nothing"),
        ("unconfirmed", "taken back"),
    ):
        count = int(flights[column].sum())
        happened += f", {count} {words}" if count else ""
    most = flights[["tilt_deg", "ground_m_s", "again_m_s"]].astype(float).max()
    worst = [f"tilt {most['tilt_deg']:.0f}°"]
    worst += [f"ground {most['ground_m_s']:.2f} m/s"] if flights["ground_m_s"].notna().any() else []
    worst += [f"second contact {most['again_m_s']:.2f} m/s"] if most["again_m_s"] > 0.0 else []
    return {
        "kind": GROUP_OF[name],
        "fault": name,
        "injected": FLOWN[name].injected,
        "expected": FLOWN[name].expects,
        "n": len(flights),
        "happened": happened,
        "worst": ", ".join(worst) if flights["tilt_deg"].notna().any() else "–",
        "verdict": f"**{bad} of {len(flights)} not**" if bad else "holds",
    }


def complaints(rows: pd.DataFrame) -> str:
    """The commonest of each row, without the moment, so that one cause counts as one; of a traceback the last line."""
    found = []
    for name, texts in (
        rows.explode("complaints").dropna(subset="complaints").groupby("fault", sort=False)["complaints"]
    ):
        causes = Counter(text.strip().splitlines()[-1].partition(" at ")[0][:160] for text in texts)
        found += [{"fault": name, "times": count, "what": cause} for cause, count in causes.most_common(_SHOWN)]
    return table(found)
