"""`python -m bench flights`: every recorded flight of some folders through the detector, and what it told of each.

A corpus of real flights gives the rate of false alarms. Its logs are not committed; labels of them are, made by
looking at the pages that this study writes.
"""

import math
from argparse import Namespace
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import yaml

from bench.fly.campaign import Json
from bench.rows.tables import at_most_an_hour, table
from bench.studies.study import Shown, page_path, write_page
from companion.mission.config import CompanionConfig
from rebound_cli.logs.log import LogError
from rebound_cli.logs.reader import read_log
from rebound_cli.replay.report import Replay, replay_log
from rebound_cli.report import page as report_page
from rebound_cli.report.shown_flight import replayed_flight

SUFFIXES = (".ulg", ".bin", ".log", ".tlog")
LABELS = Path(__file__).with_name("flights.yaml")
# A contact bounces and tumbles: ArduPilot's crash check waits for so long, too (crash_check.cpp, 2 s).
ONE_EVENT_US = 2_000_000
# A label is read off a page.
LABEL_S = 1.0
# A crash is reported within this time of its greatest deceleration.
CRASH_WITHIN_S = 0.2
# The label of what was told where nothing was, with the reason above it.
NOTHING = "nothing"
WORST_FIRST = ("crash", "collision", "touchdown")
COLUMNS = ["log", "vehicle", "flown_h", "watched_h", "imu_hz"]
COLUMNS += ["collisions", "touchdowns", "crashes", "promised", "wrong"]


@dataclass(frozen=True, slots=True)
class Event:
    """What was told of one contact with all that followed it: by its worst, a crash before a collision. `late_s`: how
    long after its greatest deceleration the first crash of it was told, negative before.
    """

    at_s: float
    until_s: float
    told: str
    late_s: float | None = None


def events(replay: Replay) -> Iterator[Event]:
    impacts, groups = replay.findings.impacts, list[list[tuple[int, str]]]()
    told = [(f.at_us, "crash" if f.is_crash else "collision" if f.is_collision else "touchdown") for f in impacts]
    told += [(at_us, "crash") for at_us, text in replay.findings.happenings if text.startswith("crashed")]
    for at_us, what in sorted(told):
        if not groups or at_us - groups[-1][-1][0] >= ONE_EVENT_US:
            groups.append([(at_us, what)])
        else:
            groups[-1].append((at_us, what))
    for group in groups:
        worst = min((what for _, what in group), key=WORST_FIRST.index)
        first_s, last_s = (replay.log.seconds(group[place][0]) for place in (0, -1))
        yield Event(first_s, last_s, worst, _late_s(replay, group) if worst == "crash" else None)


def _late_s(replay: Replay, group: Sequence[tuple[int, str]]) -> float:
    first_us, last_us = group[0][0] - 1e6 * LABEL_S, group[-1][0] + 1e6 * LABEL_S
    samples = [(at_us, sample) for at_us, sample in replay.log.imu() if first_us <= at_us <= last_us]
    hardest_us, _ = max(samples, key=lambda item: math.hypot(*item[1].specific_force_frd_m_s2))
    return 1e-6 * (next(at_us for at_us, what in group if what == "crash") - hardest_us)


def mistakes(found: Sequence[Event], labels: Mapping[float, str]) -> Iterator[str]:
    """Each event that a label contradicts, each hit that none explains, each label that nothing was told of."""
    near = {at_s: [e for e in found if _is_near(e, at_s)] for at_s, what in labels.items() if what != NOTHING}
    labelled = [event for told in near.values() for event in told]
    for at_s, events_near in near.items():
        told = [event for event in events_near if event.told == labels[at_s]]
        if not told:
            others = ", ".join(event.told for event in events_near) or "nothing"
            yield f"{labels[at_s]} at {at_s:.1f} s told as {others}"
        elif (late_s := told[0].late_s) is not None and late_s > CRASH_WITHIN_S:
            yield f"crash at {at_s:.1f} s told {late_s:.2f} s late"
    for event in found:
        if event.told != "touchdown" and event not in labelled:
            yield f"{event.told} at {event.at_s:.1f} s, where nothing was"


def _is_near(event: Event, at_s: float) -> bool:
    return event.at_s - LABEL_S <= at_s <= event.until_s + LABEL_S


def row_of(name: str, replay: Replay, labels: Mapping[float, str]) -> Json:
    """Of one log. `promised` and the counts are of the hours watched."""
    found, findings = list(events(replay)), replay.findings
    told = Counter(event.told for event in found)
    return {
        "log": name,
        "vehicle": replay.log.vehicle,
        "flown_h": findings.flown_us / 3.6e9,
        "watched_h": findings.watched_us / 3.6e9,
        "imu_hz": replay.log.imu_rate_hz,
        "collisions": told["collision"],
        "touchdowns": told["touchdown"],
        "crashes": told["crash"],
        "promised": findings.promised,
        "wrong": list(mistakes(found, labels)),
    }


def sums_text(rows: pd.DataFrame) -> str:
    """Of the logs of which anything was watched."""
    if not len(rows):
        return "Nothing was watched.\n"
    sums, hours = rows.sum(numeric_only=True), rows["watched_h"].sum()
    false = sum(wrong.endswith("where nothing was") for wrong in rows["wrong"].explode().dropna())
    return (
        f"{len(rows)} logs, {sums['flown_h']:.2f} h flown, {hours:.2f} h watched: {sums['collisions']:.0f} collisions, "
        f"{sums['touchdowns']:.0f} touchdowns, {sums['crashes']:.0f} crashes. {false} collisions or crashes where "
        f"nothing was: {false / hours:.1f} an hour, at most {at_most_an_hour(false, hours):.1f} with 95 % confidence; "
        f"{sums['promised']:.2g} in these hours promised by Gaussian noise.\n"
    )


def run_flights(options: Namespace) -> int:
    labels = yaml.safe_load((options.labels or LABELS).read_text()) or {}
    page, rows, refused = page_path(options.out, "flights"), [], []
    files = (path for folder in options.folders for path in folder.rglob("*"))
    for path in sorted(path for path in files if path.suffix.lower() in SUFFIXES):
        name = f"{path.parent.name}/{path.name}"
        try:
            replay = replay_log(read_log(path), CompanionConfig())
        except LogError as error:
            refused.append(str(error))
            continue
        rows.append(row_of(name, replay, labels.get(name, {})))
        if replay.findings.collisions:
            shown = page.parent / f"{path.parent.name}-{path.stem}.html"
            report_page.write_page(replayed_flight(replay), shown)
        print(f"{name}: {rows[-1]['watched_h'] * 60:.1f} min watched, {rows[-1]['collisions']} collisions")
    found = pd.DataFrame(rows, columns=COLUMNS)
    seen, idle = found[found["watched_h"] > 0.0], found[found["watched_h"] == 0.0]["log"]
    shown = seen.assign(promised=seen["promised"].map("{:.2g}".format), wrong=seen["wrong"].map("; ".join)).round(3)
    parts = {"": f"{sums_text(seen)}\n{table(shown)}"}
    parts["No evidence, because nothing of it was watched"] = "\n".join(idle) + "\n"
    parts["Not replayed"] = "\n".join(refused) + "\n"
    write_page(page, "Recorded flights", options.typed, Shown(parts, rows=found))
    print(sums_text(seen) if rows else "no log found")
    return 0 if rows else 1
