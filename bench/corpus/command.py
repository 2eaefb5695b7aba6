"""`bench corpus`: records flights, judges them with this version of the code, compares two versions' verdicts."""

import json
from argparse import Namespace
from pathlib import Path

from bench.campaign.plan import Campaign, Json
from bench.campaign.run import Results, Workers, failures_text, run_campaign
from bench.corpus.comparison import comparison_text
from bench.corpus.recording import record
from bench.corpus.verdict import CorpusCase, work_out
from bench.detectors.campaigns import healthy_campaign, injected_campaign
from bench.detectors.watching import FLOWN_WITH
from bench.places import make_folder, make_place
from bench.processes import in_processes
from bench.random_missions.generator import AIRFRAMES, MissionCase
from companion.errors import ReboundError
from rebound_cli.results.run_folder import TLOG_NAME, TRUTH_NAME, write_json

# Each recorded impact so often, each time in another flight.
ROUNDS = 4
USES = ("bench.baselines", "bench.detectors", "bench.random_missions")


class CorpusError(ReboundError):
    """A folder without flights, or a file without verdicts."""


def run_record(options: Namespace) -> int:
    make_folder(options.folder)
    seeds = range(options.first_seed, options.first_seed + options.missions)
    cases = [MissionCase(seed, kind, is_drawn=True) for seed in seeds for kind in AIRFRAMES]
    places = [(options.folder / f"{case.airframe}-{case.seed}", case) for case in cases]
    in_processes(record, places, options.jobs)
    print(f"{options.folder}: {len(flights(options.folder))} flights.")
    return 0


def flights(folder: Path) -> list[Path]:
    """Every folder below with bytes and truth, in the order of their names."""
    return sorted(file.parent for file in folder.rglob(TRUTH_NAME) if (file.parent / TLOG_NAME).exists())


def run_judge(options: Namespace) -> int:
    """0 when every flight has its verdict, whatever it is; 1 when one could not be read."""
    make_place(options.out)
    found = flights(options.folder)
    if not found:
        raise CorpusError(f"{options.folder}: no run folder with {TLOG_NAME} and {TRUTH_NAME} in it.")
    workers = Workers(options.jobs, options.scheduler)
    names = [str(folder.relative_to(options.folder)) for folder in found]
    cases = [CorpusCase(str(folder.resolve())) for folder in found]
    campaign = Campaign("corpus", {"flights": names}, cases, work_out, USES)
    results = run_campaign(campaign, workers)
    verdicts: Json = {"version": campaign.version, "flights": {names[n]: r for n, r in results.results.items()}}
    texts = [failures_text(campaign, results)]
    if options.data is not None:
        verdicts["recorded"], text = _recorded(options.data, workers)
        texts.append(text)
    write_json(options.out, verdicts)
    print(f"Written to {options.out}.")
    failed = [text for text in texts if text]
    for text in failed:
        print(text)
    return 1 if failed else 0


def _recorded(data: Path, workers: Workers) -> tuple[Json, str]:
    """Real logs, and recorded impacts in them, by the detector that flies."""
    healthy, injected = healthy_campaign(data, FLOWN_WITH), injected_campaign(data, ROUNDS, FLOWN_WITH)
    flown, struck = run_campaign(healthy, workers), run_campaign(injected, workers)
    text = failures_text(healthy, flown) + failures_text(injected, struck)
    return {"healthy": _listed(flown), "impacts": _listed(struck)}, text


def _listed(results: Results) -> list[Json]:
    return [result["rates"] for result in results.results.values()]


def run_compare(options: Namespace) -> int:
    print(comparison_text(_read(options.old), _read(options.new)))
    return 0


def _read(file: Path) -> Json:
    try:
        verdicts: Json = json.loads(file.read_text(encoding="utf-8"))
        verdicts["flights"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise CorpusError(f"{file}: no verdicts in it; `python -m bench corpus judge` writes such a file.") from error
    return verdicts
