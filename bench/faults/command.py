"""`bench faults`: every fault by the dozen, and the table of what became of them."""

import multiprocessing
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path

from bench.campaign.plan import Campaign, Json, Outcome
from bench.campaign.record import Record, append
from bench.campaign.run import RECORDS_FOLDER
from bench.faults import latency
from bench.faults.catalogue import FILES, FLOWN
from bench.faults.seeds import fly_faults, fly_seed
from bench.faults.table import PART, TITLE, Row, text_of
from bench.marked import checked_text, write_part
from bench.processes import ctrl_c_waiting
from bench.stamps import stamp_text
from companion.errors import ConfigurationError
from rebound_cli.live.console import with_progress

FLOWN_CODE = (
    "companion",
    "sim_vehicle",
    "rebound_cli/live/realtime.py",
    "bench/faults/flight.py",
    "bench/faults/catalogue.py",
)
# A flight's number in the record is its row's plus so many for each seed.
NAMES = (*FLOWN, *FILES)


def run_faults(options: Namespace) -> int:
    """0 when every row did what is expected of it."""
    if options.only is not None:
        return _only(options.only, options.seeds)
    checked_text(options.out, PART, TITLE)
    campaign = faults_campaign()
    record = Record(campaign, RECORDS_FOLDER)
    try:
        for number, results in with_progress(_flown_seeds(record, options), options.seeds, "faults"):
            for name, result in results.items():
                record.add_from_another_process(Outcome(_case(number, name), result))
        under_load = _under_load(record, options.hits)
    finally:
        record.close()
    rows = [row for name in NAMES if (row := _row(record, name, options.seeds)).results]
    stamp = stamp_text(f"python -m bench faults --seeds {options.seeds}", FLOWN_CODE)
    write_part(options.out, PART, text_of(rows, under_load, stamp), TITLE)
    failing = [row.name for row in rows if row.failures]
    print(f"{len(rows)} rows, {len(failing)} not as expected{': ' if failing else ''}{', '.join(failing)}.")
    print(f"Written to {options.out}.")
    return 1 if failing else 0


def faults_campaign() -> Campaign:
    """What its record is kept for; seeds and rows may come in any number."""
    return Campaign("faults", {}, (), fly_seed, ("bench.random_missions",))


def _case(number: int, name: str) -> int:
    return number * len(NAMES) + NAMES.index(name)


def _flown_seeds(record: Record, options: Namespace) -> Iterator[tuple[int, Json]]:
    """Seeds as they come, each with what became of all that the record did not have of it."""
    wanted = [(number, _missing(record, number)) for number in range(options.seeds)]
    yield from ((number, {}) for number, names in wanted if not names)
    with ctrl_c_waiting() as pressed:
        pool = multiprocessing.get_context("spawn").Pool(options.jobs)
    with pool:
        if pressed:
            raise KeyboardInterrupt
        cases = [(number, names, record.path) for number, names in wanted if names]
        yield from pool.imap_unordered(fly_numbered, cases)


def _missing(record: Record, number: int) -> list[str]:
    names = [name for name in FLOWN if _case(number, name) not in record.outcomes]
    files = [name for name in FILES if _case(number, name) not in record.outcomes]
    return names + [name for name in files if number < FILES[name].most_tries]


def fly_numbered(case: tuple[int, Sequence[str], Path]) -> tuple[int, Json]:
    """The seed's number with its results, each of which is in the record's file as soon as it is known."""
    number, names, path = case
    results: Json = {}

    def take(name: str, result: Json) -> None:
        results[name] = result
        append(path, Outcome(_case(number, name), result))

    fly_faults(number, names, take)
    return number, results


def _row(record: Record, name: str, seeds: int) -> Row:
    numbers = [_case(number, name) for number in range(seeds)]
    results = [outcome.result for n in numbers if (outcome := record.outcomes.get(n)) is not None]
    return Row(FLOWN.get(name) or FILES[name], [result for result in results if result is not None])


def _under_load(record: Record, hits: int) -> Json | None:
    """Measured once; a negative number is no case's."""
    if -hits not in record.outcomes:
        record.add(Outcome(-hits, latency.measured(hits)))
    return record.outcomes[-hits].result


def _only(name: str, seeds: int) -> int:
    if name not in NAMES:
        raise ConfigurationError(f"--only {name}: there is no such fault; there are {', '.join(NAMES)}.")
    results = [fly_seed((number, [name]))[name] for number in range(seeds)]
    for number, result in enumerate(results):
        print(f"{number}: {result}")
    return 1 if any(result["complaints"] for result in results) else 0
