"""Campaigns: thousands of independent cases in this process, on every core, or on a Dask cluster.

Rows go into a file that only grows, one line a case, so that a broken-off run goes on. They are the same whoever works
them out. A case carries its own seed, so that it does not matter which worker gets it, or when.
"""

import gc
import hashlib
import importlib
import json
import logging
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

import dask
from distributed import Client, as_completed
from rich.console import Console
from rich.progress import track

from companion.errors import ReboundError
from rebound_cli import __version__

Json = dict[str, Any]

# A task takes some hundred microseconds of the scheduler, a case a tenth of a second at least.
CASES_PER_TASK = 8
# How long a scheduler may take to answer before it counts as not there.
CONNECT_TIMEOUT_S = 10
RECORDS_FOLDER = Path("runs") / "campaigns"
# Half of a SHA-256 in hexadecimal digits would do against accidents; this much is still readable in a file's name.
KEY_DIGITS = 16
# All code that a row may depend on, beside the module of the function that makes it. Studies only look at rows.
CODE = (
    *("companion", "sim_vehicle", "rebound_cli"),
    *("bench.cases", "bench.detectors", "bench.faults", "bench.fly", "bench.rows"),
)


class CampaignError(ReboundError):
    """A scheduler that cannot be used, or a file of results that is damaged or another campaign's."""


@dataclass(frozen=True, slots=True)
class Campaign:
    """A name, the parameters from which all cases follow, the cases, and what is done with each.

    `work_out` is a function of a module (workers import it) from a case to what JSON can hold.
    """

    name: str
    parameters: Mapping[str, Any]
    cases: Sequence[Any]
    work_out: Callable[[Any], Json]

    @property
    def head(self) -> Json:
        """The first line of its record. The same for the same parameters and code."""
        version = code_version(self.work_out.__module__)
        return {"campaign": self.name, "version": version, "parameters": dict(self.parameters)}

    def record_path(self, folder: Path = RECORDS_FOLDER) -> Path:
        """A file of its own for other parameters and for other code."""
        key = hashlib.sha256(json.dumps(self.head, sort_keys=True).encode()).hexdigest()[:KEY_DIGITS]
        return folder / f"{self.name}-{key}.jsonl"


@dataclass(frozen=True, slots=True)
class Workers:
    """Processes on this machine, or the address of a Dask scheduler whose workers have this package installed."""

    jobs: int = 1
    scheduler: str | None = None


@dataclass(frozen=True, slots=True)
class Results:
    """Results by case number in ascending order, and the failures."""

    results: dict[int, Json]
    failures: dict[int, str]

    def text(self, campaign: Campaign) -> str:
        """One line a failed case, with what is needed to see it again; empty where there is none."""
        lines = (f"{campaign.name}: case {at} failed: {why}; {campaign.cases[at]}" for at, why in self.failures.items())
        return "\n".join(lines)


def run_campaign(campaign: Campaign, workers: Workers, folder: Path = RECORDS_FOLDER) -> Results:
    """Work out every case that the record does not have yet, failed ones again; all results, in the order of cases.

    Raises CampaignError for a damaged record, and a scheduler that is not there or has other code than this process.
    """
    path = campaign.record_path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    known = read_record(path) if path.exists() else {}
    missing = [(n, case) for n, case in enumerate(campaign.cases) if "result" not in known.get(n, {})]
    if known and missing:
        done = len(campaign.cases) - len(missing)
        print(f"{campaign.name}: going on after {done} of {len(campaign.cases)} cases", file=sys.stderr)
    with path.open("a", encoding="utf-8") as file:
        if file.tell() == 0:
            _write(file, campaign.head)
        try:
            found = outcomes(campaign.work_out, missing, workers)
            for outcome in _with_progress(found, len(missing), campaign.name) if missing else ():
                known[outcome["case"]] = _write(file, outcome)
        except KeyboardInterrupt:
            text = f"{campaign.name}: broken off after {len(known)} cases; the same command goes on from there"
            print(f"\n{text}", file=sys.stderr)
            raise
    # Without what a longer campaign of the same cases has beyond them.
    ordered = {number: known[number] for number in sorted(known) if number < len(campaign.cases)}
    return Results(*({n: one[word] for n, one in ordered.items() if word in one} for word in ("result", "failure")))


def rows_of(campaign: Campaign, workers: Workers) -> list[Json]:
    """Of a campaign whose results are rows already. Raises CampaignError where a case failed."""
    results = run_campaign(campaign, workers)
    if results.failures:
        raise CampaignError(results.text(campaign))
    return [*results.results.values()]


def outcomes(function: Callable[[Any], Any], cases: Sequence[tuple[int, Any]], workers: Workers) -> Iterator[Json]:
    """Of each case its number and its result or failure, as they come. Here, where one process is enough."""
    if workers.scheduler is None and workers.jobs == 1:
        for case in cases:
            yield from work_out(function, [case])
        return
    # Compiled kernels are in the cache after one case; two processes would compile them twice.
    yield from work_out(function, cases[:1])
    rest = cases[1:]
    if not rest:
        return
    logging.getLogger("distributed").setLevel(logging.ERROR)
    with _client(workers) as client:
        _check_versions(client, function.__module__)
        tasks = [rest[start : start + CASES_PER_TASK] for start in range(0, len(rest), CASES_PER_TASK)]
        futures = {client.submit(work_out, function, task, pure=False): task for task in tasks}
        for future in as_completed(list(futures)):
            task = futures.pop(future)
            if future.status == "finished":
                yield from future.result()
            else:
                # Not the cases' own exceptions, which are outcomes: a worker that died, time and again.
                yield from ({"case": number, "failure": f"worker lost: {future.exception()!r}"} for number, _ in task)
            future.release()


def work_out(function: Callable[[Any], Any], numbered: Sequence[tuple[int, Any]]) -> list[Json]:
    """The outcomes of some cases. An exception is that case's outcome and does not stop the next."""
    # A case makes millions of small objects and hardly a cycle: looking for cycles all the time is a third of its cost.
    gc.disable()
    try:
        return [_outcome(function, number, case) for number, case in numbered]
    finally:
        gc.enable()


def _outcome(function: Callable[[Any], Any], number: int, case: Any) -> Json:
    try:
        return {"case": number, "result": function(case)}
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        at = f"{Path(where.filename).name}:{where.lineno}"
        return {"case": number, "failure": f"{type(error).__name__}: {error} ({at})"}


def read_record(path: Path) -> dict[int, Json]:
    """The outcomes by case number of a file of results.

    Half a line at its end, of a run that was killed while it wrote, is cut off. Raises CampaignError, OSError.
    """
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    if len(whole) < len(content):
        path.write_bytes(whole)
    found = {}
    for number, line in enumerate(whole.splitlines()[1:], start=2):
        try:
            entry = dict(json.loads(line))
            found[entry["case"]] = entry
        except (ValueError, KeyError, TypeError) as error:
            raise CampaignError(f"{path} is damaged in line {number}; move it away.") from error
    return found


def code_version(module: str) -> str:
    """Release and a digest of all code that a row of this module's function may depend on."""
    digest = hashlib.sha256(_file(module).read_bytes())
    for folder in (_file(name).parent for name in CODE):
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".py", ".yaml"):
                digest.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    return f"{__version__}+{digest.hexdigest()[:KEY_DIGITS]}"


def _file(module: str) -> Path:
    return Path(str(importlib.import_module(module).__file__))


def _client(workers: Workers) -> Client:
    if workers.scheduler is None:
        # A worker's profile of itself grows by a megabyte every ten seconds of work.
        dask.config.set({"distributed.worker.profile.enabled": False})
        # Ctrl-C reaches every process of the terminal. Workers inherit that it is blocked: only this one hears it.
        resource_tracker.ensure_running()  # it unblocks the signal when it starts, with the first worker otherwise
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            # Its cluster ends with it.
            quiet = {"dashboard_address": "127.0.0.1:0", "silence_logs": 50}
            return Client(n_workers=workers.jobs, threads_per_worker=1, processes=True, **quiet)
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    try:
        return Client(workers.scheduler, timeout=CONNECT_TIMEOUT_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise CampaignError(
            f"no Dask scheduler answers at {workers.scheduler} ({error}); start one with `dask scheduler`, "
            "or leave --scheduler away"
        ) from error


def _check_versions(client: Client, module: str) -> None:
    """The same result whoever computes needs the same code everywhere."""
    ours, versions = code_version(module), client.run(code_version, module)
    if not versions:
        raise CampaignError("the Dask scheduler has no workers; start some with `dask worker ADDRESS`")
    for address, version in versions.items():
        if version != ours:
            raise CampaignError(
                f"the worker {address} has version {version} and this is {ours}; install the same on both"
            )


def _write(file: Any, entry: Json) -> Json:
    """Read back as it will be by a run that goes on: numbers then are the same bits either way."""
    line = json.dumps(entry, separators=(",", ":"))
    file.write(line + "\n")
    file.flush()
    read_back: Json = json.loads(line)
    return read_back


def _with_progress(found: Iterator[Json], total: int, what: str) -> Iterable[Json]:
    """With a bar on the terminal; in a file or a pipe nothing is drawn."""
    console = Console(stderr=True)
    return track(found, what, total, console=console, disable=not console.is_terminal)
