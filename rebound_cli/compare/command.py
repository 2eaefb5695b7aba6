"""`rebound compare`: the flights, on all cores or a Dask scheduler's workers, and what is written of them."""

import contextlib
import io
import multiprocessing
import os
import signal
import threading
import time
from argparse import Namespace
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, as_completed
from datetime import UTC, datetime
from pathlib import Path

from companion.errors import ConfigurationError, ReboundError
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
            case = given[done]
            try:
                row = done.result()
            except (BrokenExecutor, OSError) as error:
                # A full disk, or a worker that was killed, with which the pool flies no more: what was flown is kept.
                row = row_of(case, None, f"failed: {error}")
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
        spawn = multiprocessing.get_context("spawn")
        # Ctrl-C ends a flight, not a process that waits for the next one. Nor does one outlive a SIGTERM.
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            with ProcessPoolExecutor(os.cpu_count(), spawn, signal.signal, (signal.SIGINT, signal.SIG_IGN)) as pool:
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


# A worker of Dask has threads, and all share its standard output.
_ONE_AT_A_TIME = threading.Lock()


def _fly(mission: Path, airframe: str | None, case: Case, out: Path) -> Row:
    """One, as `rebound fly --lockstep` does it; here, in a process of the pool, or in a thread of Dask's."""
    from rebound_cli.main import build_parser

    words = ["fly", str(mission), "--lockstep", "--seed", str(case.seed), "--out", str(out / case.folder)]
    words += [] if airframe is None else ["--airframe", airframe]
    words += [word for one in case.sets for word in ("--set", one)]
    options, said = build_parser().parse_args(words), io.StringIO()
    with _ONE_AT_A_TIME, contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            options.run(options)
        except ReboundError as error:
            return row_of(case, None, str(error))
    return row_of(case, read_summary(out / case.folder))
