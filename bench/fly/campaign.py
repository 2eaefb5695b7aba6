"""Campaigns: thousands of independent cases, in this process or on every core.

Results go into a file that only grows, one line a case: a broken-off run goes on, and a longer one goes on where a
shorter one ended. They are the same whoever works them out. A case carries its own seed.
"""

import gc
import hashlib
import importlib
import json
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track

from companion.errors import ReboundError
from rebound_cli import __version__

Json = dict[str, Any]

RECORDS_FOLDER = Path("runs") / "campaigns"
# Half of a SHA-256 in hexadecimal digits would do against accidents; this much is still readable in a file's name.
KEY_DIGITS = 16
# All code that a row may depend on.
CODE = ("companion", "sim_vehicle", "rebound_cli", "bench")


class CampaignError(ReboundError):
    """A file of results that is damaged, a worker that died, or a case that failed."""


@dataclass(frozen=True, slots=True)
class Results:
    """Every case with its result, in the order of the cases; of each that failed a line with what it needs again."""

    found: Sequence[tuple[Any, Json]]
    failures: Sequence[str] = ()

    def rows(self) -> list[Json]:
        """The case's own numbers, and its result's."""
        return [{**asdict(case), **result} for case, result in self.found]


def run_campaign(
    name: str, cases: Sequence[Any], work_out: Callable[[Any], Json], jobs: int, folder: Path = RECORDS_FOLDER
) -> Results:
    """Work out every case that the file of results does not have yet, failed ones again.

    `work_out` is a function of a module (workers import it) from a case to what JSON can hold. Raises CampaignError.
    """
    path = record_path(name, folder)
    known = read_record(path)
    missing = [case for case in cases if "result" not in known.get(repr(case), {})]
    if missing and len(missing) < len(cases):
        print(f"{name}: going on after {len(cases) - len(missing)} of {len(cases)} cases", file=sys.stderr)
    console = Console(stderr=True)
    outcomes = worked_out(work_out, missing, jobs)
    folder.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        try:
            for outcome in track(outcomes, name, len(missing), console=console, disable=not console.is_terminal):
                line = json.dumps(outcome, separators=(",", ":"))
                file.write(line + "\n")
                file.flush()
                # Read back as by a run that goes on: numbers then are the same bits either way.
                known[outcome["case"]] = json.loads(line)
        except KeyboardInterrupt:
            print(f"\n{name}: broken off; the same command goes on from there", file=sys.stderr)
            raise
    ended = [(case, known[repr(case)]) for case in cases]
    failures = [f"{name}: {one['failure']}; {case}" for case, one in ended if "failure" in one]
    return Results([(case, one["result"]) for case, one in ended if "result" in one], failures)


def worked_out(work_out: Callable[[Any], Json], cases: Sequence[Any], jobs: int) -> Iterator[Json]:
    """Of each case its result or failure, as they come. Raises CampaignError for a worker that died."""
    # Compiled kernels are in the cache after one case; two processes would compile them twice.
    alone = 1 if jobs > 1 else len(cases)
    for case in cases[:alone]:
        yield _outcome(work_out, case)
    if not cases[alone:]:
        return
    # Ctrl-C reaches every process of the terminal: only this one hears it.
    workers = ProcessPoolExecutor(jobs, initializer=signal.signal, initargs=(signal.SIGINT, signal.SIG_IGN))
    try:
        for done in as_completed([workers.submit(_outcome, work_out, case) for case in cases[alone:]]):
            yield done.result()
    except BrokenProcessPool as error:
        raise CampaignError("A worker died; the same command goes on from there.") from error
    finally:
        workers.shutdown(cancel_futures=True)


def _outcome(work_out: Callable[[Any], Json], case: Any) -> Json:
    """An exception is that case's outcome and does not stop the next."""
    # A case makes millions of small objects and hardly a cycle: looking for cycles all the time is a third of its cost.
    gc.disable()
    try:
        return {"case": repr(case), "result": work_out(case)}
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        at = f"{Path(where.filename).name}:{where.lineno}"
        return {"case": repr(case), "failure": f"{type(error).__name__}: {error} ({at})"}
    finally:
        gc.enable()


def record_path(name: str, folder: Path = RECORDS_FOLDER) -> Path:
    """A file of its own for other code: the release, and a digest of all code that a row may depend on."""
    digest = hashlib.sha256()
    for room in (Path(str(importlib.import_module(module).__file__)).parent for module in CODE):
        for path in sorted(room.rglob("*")):
            if path.suffix in (".py", ".yaml"):
                digest.update(path.relative_to(room).as_posix().encode() + path.read_bytes())
    return folder / f"{name}-{__version__}-{digest.hexdigest()[:KEY_DIGITS]}.jsonl"


def read_record(path: Path) -> dict[str, Json]:
    """The outcomes of a file of results by their cases; none where there is no file.

    Half a line at its end, of a run that was killed while it wrote, is cut off. Raises CampaignError, OSError.
    """
    content = path.read_bytes() if path.exists() else b""
    whole = content[: content.rfind(b"\n") + 1]
    if len(whole) < len(content):
        path.write_bytes(whole)
    found = {}
    for number, line in enumerate(whole.splitlines(), start=1):
        try:
            entry = dict(json.loads(line))
            found[entry["case"]] = entry
        except (ValueError, KeyError, TypeError) as error:
            raise CampaignError(f"{path} is damaged in line {number}; move it away.") from error
    return found
