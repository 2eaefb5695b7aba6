"""`bench detectors`: works the campaigns out, writes the tables of build/detection.md and the pictures."""

import time
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from bench.arguments import DRAWN_NAME, DRAWN_TITLE
from bench.campaign.plan import Campaign
from bench.campaign.run import Results, Workers, failures_text, run_campaign
from bench.detectors.campaigns import (
    Drawing,
    flights_campaign,
    hands_campaign,
    healthy_campaign,
    hits_campaign,
    injected_campaign,
)
from bench.detectors_report import comparison, families, flights, hit_bars, hits, pictures
from bench.detectors_report.bars import Bar, bars_text, summary_text
from bench.detectors_report.numbers import Hits
from bench.detectors_report.reading import HOW_TO_READ
from bench.marked import checked_text, write_part
from bench.places import make_folder
from bench.stamps import stamp_text

DOCUMENT_NAME, PICTURES_FOLDER = "detection.md", Path("images") / "detection"
PART, TITLE = "detectors", "Detection"
# Recorded impacts: each once for a first look, more often where the hits are many.
HITS_PER_ROUND = 2500


def run_detectors(options: Namespace) -> int:
    """0 when everything is written, whatever it says; 1 when a case failed."""
    make_folder(options.out)
    drawing = Drawing(options.first_seed, options.vehicles == "drawn")
    name, title = (DRAWN_NAME, DRAWN_TITLE) if drawing.is_drawn else (DOCUMENT_NAME, TITLE)
    checked_text(options.out / name, PART, title)
    started_s = time.monotonic()
    workers = Workers(options.jobs, options.scheduler)
    campaigns = [
        hits_campaign(options.hits, drawing),
        hands_campaign(options.hits, drawing),
        flights_campaign(options.hours, drawing),
    ]
    if options.data is not None:
        rounds = max(1, round(options.hits / HITS_PER_ROUND))
        campaigns += [healthy_campaign(options.data), injected_campaign(options.data, rounds)]
    worked_out = {campaign.name: (campaign, run_campaign(campaign, workers)) for campaign in campaigns}
    failures = [text for campaign, results in worked_out.values() if (text := failures_text(campaign, results))]
    bars = _bars(worked_out)
    lead = _lead(options, worked_out, failures)
    if drawing.is_drawn:
        text = "\n".join([lead, *_headed([("What must be shown", bars_text(bars)), *_tables(worked_out)])])
        write_part(options.out / name, PART, text, title)
    else:
        sections = _sections(worked_out, bars)
        _write(options.out, "\n".join([lead, *sections]), _figures(worked_out))
    print(summary_text(bars))
    for text in failures:
        print(text)
    print(f"Written to {options.out / name} in {time.monotonic() - started_s:.0f} s.")
    return 1 if failures else 0


Worked = Mapping[str, tuple[Campaign, Results]]


def _hits(worked_out: Worked) -> Hits:
    campaign, results = worked_out["hits"]
    return Hits(campaign.cases, results.results)


def _bars(worked_out: Worked) -> list[Bar]:
    bars = hit_bars.hit_bars(_hits(worked_out)) + families.family_bars(_hits(worked_out))
    campaign, results = worked_out["hands"]
    bars += families.hand_bars(campaign.cases, results.results)
    campaign, results = worked_out["flights"]
    bars += flights.flight_bars(campaign.cases, results.results)
    for name, judge in (("recorded-flights", flights.recorded_bars), ("recorded-impacts", flights.injected_bars)):
        if name in worked_out:
            recorded, found = worked_out[name]
            bars += judge(recorded.cases, found.results)
    return bars + comparison.comparison_bars(_hits(worked_out), campaign.cases, results.results)


Parts = list[tuple[str, str]]


def _sections(worked_out: Worked, bars: list[Bar]) -> list[str]:
    every, *others = _tables(worked_out)
    parts: Parts = [
        ("What must be shown", bars_text(bars)),
        ("", HOW_TO_READ),
        every,
        ("", "![detection rate by speed](images/detection/speed.png)\n"),
        ("", "![false alarms against detection rate](images/detection/roc.png)\n"),
        ("", "![latency](images/detection/latency.png)\n"),
        *others,
    ]
    return _headed(parts)


def _headed(parts: Parts) -> list[str]:
    return [f"### {title}\n\n{text}" if title else text for title, text in parts]


def _tables(worked_out: Worked) -> Parts:
    flown, results = worked_out["flights"]
    held, in_hand = worked_out["hands"]
    all_hits = _hits(worked_out)
    parts: Parts = [
        ("Every detector on simulated hits", hits.comparison_text(all_hits)),
        (f"Beside `{comparison.BASELINE}`", comparison.baseline_text(all_hits)),
        ("By obstacle", hits.approaches_text(all_hits)),
        ("By speed", hits.speeds_text(all_hits)),
        ("By vibration", hits.vibrations_text(all_hits)),
        ("By the quality of the vehicle's velocity", hits.velocity_text(all_hits)),
        ("Over a bad link, and struck in hover", families.families_text(all_hits)),
        ("In a person's hand", families.hands_text(held.cases, in_hand.results)),
        ("Healthy flights, simulated", flights.alarms_text(flown.cases, results.results)),
        ("By kind of flight", flights.families_text(flown.cases, results.results)),
    ]
    for name, title, tell in (
        ("recorded-flights", "Recorded flights", flights.recorded_text),
        ("recorded-impacts", "Semi-synthetic: recorded impacts in recorded flights", flights.injected_text),
    ):
        if name in worked_out:
            recorded, found = worked_out[name]
            parts.append((title, tell(recorded.cases, found.results)))
    return parts


def _lead(options: Namespace, worked_out: Worked, failures: list[str]) -> str:
    """What was run and how to run it again."""
    data = "" if options.data is None else " --data DIR"
    first = f" --first-seed {options.first_seed}" if options.first_seed else ""
    which = " --vehicles drawn" if options.vehicles == "drawn" else ""
    command = f"python -m bench detectors --hits {options.hits} --hours {options.hours:g}{first}{which}{data}"
    counts = ", ".join(f"{len(results.results)} {name.replace('-', ' ')}" for name, (_, results) in worked_out.items())
    failed = f" {sum(len(r.failures) for _, r in worked_out.values())} cases failed." if failures else ""
    return f"\n{stamp_text(command)}: {counts}.{failed}\n"


def _figures(worked_out: Worked) -> dict[str, Figure]:
    flown, results = worked_out["flights"]
    all_hits = _hits(worked_out)
    return {
        "roc.png": pictures.roc_figure(all_hits, flown.cases, results.results),
        "speed.png": pictures.speed_figure(all_hits),
        "latency.png": pictures.latency_figure(all_hits),
    }


def _write(folder: Path, text: str, figures: Mapping[str, Any]) -> None:
    """Pictures beside the document; what stands between its marks made anew, the rest left as it is."""
    (folder / PICTURES_FOLDER).mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        figure.savefig(folder / PICTURES_FOLDER / name)
    write_part(folder / DOCUMENT_NAME, PART, text, TITLE)
