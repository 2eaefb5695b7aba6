"""`rebound compare`: the flights, on all cores or a Dask scheduler's workers, and what is written of them."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from argparse import Namespace
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from datetime import UTC, datetime
from pathlib import Path

from companion.errors import ConfigurationError
from rebound_cli.compare.cases import Case, cases_of
from rebound_cli.compare.page import write_page
from rebound_cli.compare.rows import Row, row_of, table, write_csv
from rebound_cli.inputs import inputs
from rebound_cli.inputs.documents import refuse_existing
from rebound_cli.live.console import console_for
from rebound_cli.results.run_folder import RUNS_FOLDER, read_summary
from rebound_cli.simulation.compiling import prepare_vehicle
from sim_vehicle.airframe import built_in_airframes


def run_compare(options: Namespace) -> int:
    """Fly all, write the CSV and the page, print the table. 0 when every flight was flown to a summary."""
    refuse_existing(options.out)
    cases, mission = cases_of(options), options.mission.stem
    out = options.out or RUNS_FOLDER / f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-compare-{mission}"
    with _workers(options.scheduler) as workers, console_for(False) as console:
        out.mkdir(parents=True)
        console.print(f"{len(cases)} flights to {out}/")
        # Here once, not on every core.
        prepare_vehicle(console, inputs.load_world(options.mission, (), options.airframe, None))
        rows = {}
        with (
            (out / "progress.txt").open("w", encoding="utf-8", buffering=1) as progress,
            # Closed after Ctrl-C, too: what waits is not flown.
            contextlib.closing(_flown(workers, options, cases, out.absolute())) as flown,
        ):
            for case, row, line in flown:
                rows[case] = row
                console.print(line)
                progress.write(f"{line}\n")
        in_order = [rows[case] for case in cases]
        write_csv(in_order, out / "compare.csv")
        write_page(out / "compare.html", f"{mission}, {options.airframe or 'its own airframe'}", in_order)
        console.print(f"\n{table(in_order)}\n\nEvery figure: {out}/compare.csv. Plots: {out}/compare.html")
    return 0 if all(row.second_touches is not None for row in in_order) else 1


def _flown(workers: Executor, options: Namespace, cases: Sequence[Case], out: Path) -> Generator[tuple[Case, Row, str]]:
    """In the order in which they are over, each with a line of progress."""
    began_s, airframe = time.monotonic(), options.airframe
    if airframe is not None and airframe not in built_in_airframes():
        airframe = str(Path(airframe).absolute())
    given = {workers.submit(_fly, options.mission.absolute(), airframe, case, out): case for case in cases}
    try:
        for number, done in enumerate(as_completed(given), start=1):
            case, row = given[done], done.result()
            left_s = (time.monotonic() - began_s) / number * (len(cases) - number)
            hit = row.reason if row.impact_speed_m_s is None else f"hit at {row.impact_speed_m_s:.2f} m/s"
            rest = "" if row.at_rest_after_s is None else f", at rest after {row.at_rest_after_s:.1f} s"
            yield case, row, f"{number:4} of {len(cases)}, {left_s:4.0f} s to go: {case.folder}, {hit}{rest}"
    finally:
        for each in given:
            each.cancel()


@contextlib.contextmanager
def _workers(scheduler: str | None) -> Iterator[Executor]:
    """All cores, or a Dask scheduler's workers. Raises ConfigurationError where nobody answers at its address."""
    if scheduler is None:
        # No flight outlives a SIGTERM.
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                yield pool
        finally:
            signal.signal(signal.SIGTERM, before)
        return
    from distributed import Client
    from distributed.comm import resolve_address

    try:
        # Of one that is none Dask leaves a client behind that complains when it goes.
        resolve_address(scheduler)
        client = Client(scheduler, timeout="3 s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"--scheduler {scheduler}: no Dask scheduler answers there ({error}).") from None
    with client, client.get_executor() as pool:
        yield pool


def _fly(mission: Path, airframe: str | None, case: Case, out: Path) -> Row:
    """One, by `rebound fly --lockstep` in a process of its own: what ends that costs no other flight."""
    words = [sys.executable, "-m", "rebound_cli", "fly", str(mission), "--lockstep", "--seed", str(case.seed)]
    words += ["--out", str(out / case.folder), *([] if airframe is None else ["--airframe", airframe])]
    words += [word for one in case.sets for word in ("--set", one)]
    done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    said = (done.stderr.strip().splitlines() or [f"it ended with {done.returncode}"])[-1]
    return row_of(case, read_summary(out / case.folder), said.removeprefix("rebound: "))
