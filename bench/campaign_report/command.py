"""`bench campaign`: flies everything that must be shown and writes the notes campaign.md and recovery.md."""

import time
from argparse import Namespace
from pathlib import Path

from bench.arguments import BUILD, DRAWN_NAME, DRAWN_TITLE
from bench.campaign.plan import Campaign
from bench.campaign.record import record_path
from bench.campaign.run import RECORDS_FOLDER, Results, Workers, failures_text, run_campaign
from bench.campaign_report import tables
from bench.campaign_report.flown import Missions
from bench.campaign_report.law_bars import law_bars
from bench.campaign_report.mission_bars import DRAWN_WANTED, mission_bars
from bench.campaign_report.only import run_only
from bench.campaign_report.page import write_page
from bench.campaign_report.picture import missions_figure
from bench.campaign_report.reading import HOW_TO_READ
from bench.detectors_report.bars import Bar, bars_text, summary_text
from bench.marked import checked_text, write_part
from bench.places import make_folder
from bench.random_missions.campaign import missions_campaign
from bench.random_missions.generator import MissionCase
from bench.recoveries.command import PART as RECOVERY_PART
from bench.recoveries.command import write_table
from bench.recoveries.hits import recoveries_campaign
from bench.stamps import stamp_text
from companion.errors import ConfigurationError

DOCUMENT_NAME, RECOVERY_NAME, PICTURE = "campaign.md", "recovery.md", Path("images") / "campaign" / "missions.png"
PART, TITLE = "campaign", "Campaign"


def run_campaign_command(options: Namespace) -> int:
    """0 when everything is written, whatever it says; 1 when a case failed to be flown."""
    if options.only is not None:
        case = MissionCase(options.only, options.airframe or "foldable", is_drawn=options.vehicles == "drawn")
        return run_only(case, options.out)
    if options.airframe is not None:
        raise ConfigurationError("--airframe belongs to --only: a campaign flies every mission with both.")
    started_s = time.monotonic()
    workers, out = Workers(options.jobs, options.scheduler), options.out or BUILD
    if options.vehicles == "drawn":
        return _run_drawn(options, workers, out)
    _check(out)
    flown = missions_campaign(options.missions, options.first_seed)
    missions_results = run_campaign(flown, workers)
    hits = recoveries_campaign(options.hits)
    hits_results = run_campaign(hits, workers)
    worked_out = [(flown, missions_results), (hits, hits_results)]
    failed = [text for campaign, results in worked_out if (text := failures_text(campaign, results))]
    missions = Missions(flown.cases, missions_results.results)
    bars = mission_bars(missions) + law_bars(hits.cases, hits_results.results)
    _write(out, options.first_seed, _text(options, missions, bars, worked_out))
    if (out / RECOVERY_NAME).exists():
        write_table(out / RECOVERY_NAME, hits, hits_results, options.hits)
    print(summary_text(bars))
    for text in failed:
        print(text)
    shown = write_page(record_path(flown, RECORDS_FOLDER))
    print(f"Written to {out / DOCUMENT_NAME} and {shown} in {time.monotonic() - started_s:.0f} s.")
    return 1 if failed else 0


def _run_drawn(options: Namespace, workers: Workers, out: Path) -> int:
    """The same missions by vehicles that nothing was fitted to; the wall hits with both laws are the named ones'."""
    make_folder(out)
    checked_text(out / DRAWN_NAME, PART, DRAWN_TITLE)
    flown = missions_campaign(options.missions, options.first_seed, is_drawn=True)
    results = run_campaign(flown, workers)
    missions = Missions(flown.cases, results.results)
    bars = mission_bars(missions, DRAWN_WANTED)
    parts = [_lead(options, [(flown, results)]), f"### What must be shown\n\n{bars_text(bars)}", *_tables(missions)]
    write_part(out / DRAWN_NAME, PART, "\n".join(parts), DRAWN_TITLE)
    print(summary_text(bars))
    failed = failures_text(flown, results)
    print(f"{failed}Written to {out / DRAWN_NAME} and {write_page(record_path(flown, RECORDS_FOLDER))}.")
    return 1 if failed else 0


def _check(folder: Path) -> None:
    """Whether there will be a place for it all, before hours are flown. Raises ReboundError."""
    make_folder(folder)
    checked_text(folder / DOCUMENT_NAME, PART, TITLE)
    if (folder / RECOVERY_NAME).exists():
        checked_text(folder / RECOVERY_NAME, RECOVERY_PART)


def _text(options: Namespace, missions: Missions, bars: list[Bar], worked_out: list[tuple[Campaign, Results]]) -> str:
    return "\n".join(
        [
            _lead(options, worked_out),
            f"### What must be shown\n\n{bars_text(bars)}",
            HOW_TO_READ,
            *_tables(missions),
            f"![the first missions from above]({PICTURE.as_posix()})\n",
        ]
    )


def _tables(missions: Missions) -> list[str]:
    return [
        f"### Missions that did not end as they say\n\n{tables.causes_text(missions)}",
        tables.failures_text(missions),
        f"### By room, stream and wind\n\nMissions that ended as they say.\n\n{tables.kinds_text(missions)}",
        f"### Recoveries by speed\n\n{tables.speeds_text(missions)}",
    ]


def _lead(options: Namespace, worked_out: list[tuple[Campaign, Results]]) -> str:
    """What was run and how to run it again."""
    missions, *others = (results for _, results in worked_out)
    first = "" if options.first_seed == 1 else f" --first-seed {options.first_seed}"
    which = f" --hits {options.hits}" if others else " --vehicles drawn"
    command = f"python -m bench campaign --missions {options.missions}{first}{which}"
    last_seed = options.first_seed + options.missions - 1
    seconds = sum(result["seconds"] for result in missions.results.values())
    failed = sum(len(results.failures) for _, results in worked_out)
    laws = "".join(f", and {len(hits.results)} hits with a recovery law each" for hits in others)
    return (
        f"\n{stamp_text(command)}: {len(missions.results)} flights of seeds "
        f"{options.first_seed} to {last_seed}, {seconds / 3600:.1f} h in the vehicle's time{laws}."
        f"{f' {failed} cases failed.' if failed else ''}\n"
    )


def _write(folder: Path, first_seed: int, text: str) -> None:
    """The picture beside the document; what stands between its marks made anew, the rest left as it is."""
    (folder / PICTURE.parent).mkdir(parents=True, exist_ok=True)
    missions_figure(first_seed).savefig(folder / PICTURE)
    write_part(folder / DOCUMENT_NAME, PART, text, TITLE)
