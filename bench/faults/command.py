"""`bench faults`: every fault by the dozen, and the table of what became of them."""

from argparse import Namespace

from bench.campaign.plan import Campaign, Json, Outcome
from bench.campaign.record import Record
from bench.campaign.run import RECORDS_FOLDER
from bench.faults import latency
from bench.faults.catalogue import FILES, FLOWN
from bench.faults.files import tried
from bench.faults.flight import fly, fly_from_one_take_off
from bench.faults.table import PART, TITLE, Row, text_of
from bench.marked import checked_text, write_part
from companion.errors import ConfigurationError
from rebound_cli.progress import with_progress

# A flight's number in the record is its row's plus so many for each seed.
NAMES = (*FLOWN, *FILES)


def run_faults(options: Namespace) -> int:
    """0 when every row did what is expected of it."""
    if options.only is not None:
        return _only(options.only, options.seeds)
    checked_text(options.out, PART, TITLE)
    campaign = Campaign("faults", {}, (), _tried, ("bench.faults",))
    record = Record(campaign, RECORDS_FOLDER)
    try:
        for number in with_progress(iter(range(options.seeds)), options.seeds, "faults"):
            _fly_missing(record, number)
        under_load = _under_load(record, options.hits)
    finally:
        record.close()
    rows = [row for name in NAMES if (row := _row(record, name, options.seeds)).results]
    write_part(options.out, PART, text_of(rows, under_load, options.seeds, campaign.version), TITLE)
    failing = [row.name for row in rows if row.failures]
    print(f"{len(rows)} rows, {len(failing)} not as expected{': ' if failing else ''}{', '.join(failing)}.")
    print(f"Written to {options.out}.")
    return 1 if failing else 0


def _case(number: int, name: str) -> int:
    return number * len(NAMES) + NAMES.index(name)


def _fly_missing(record: Record, number: int) -> None:
    """The flights and files of one seed that the record does not have."""

    def take(name: str, result: Json) -> None:
        record.add(Outcome(_case(number, name), result))

    names = [name for name in NAMES if _case(number, name) not in record.outcomes]
    branching = [FLOWN[name] for name in names if name in FLOWN and not FLOWN[name].from_the_start]
    if branching:
        fly_from_one_take_off(number, branching, take)
    for name in names:
        if name in FILES and number < FILES[name].most_tries:
            take(name, tried(FILES[name], number))
        elif name in FLOWN and FLOWN[name].from_the_start:
            take(name, fly(number, FLOWN[name]))


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
    results = [_tried((name, n)) for n in range(seeds)]
    for number, result in enumerate(results):
        print(f"{number}: {result}")
    return 1 if any(result["complaints"] for result in results) else 0


def _tried(case: tuple[str, int]) -> Json:
    name, number = case
    return tried(FILES[name], number) if name in FILES else _flown(number, name)


def _flown(number: int, name: str) -> Json:
    fault = FLOWN[name]
    if fault.from_the_start:
        return fly(number, fault)
    results: list[Json] = []
    fly_from_one_take_off(number, [fault], lambda _, result: results.append(result))
    return results[0]
