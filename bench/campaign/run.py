"""Working a campaign out on Dask: a local cluster of processes, or a scheduler that is already there."""

import logging
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dask
from distributed import Client, LocalCluster, as_completed

from bench.campaign.plan import Campaign, Json, Outcome, code_version, work_out
from bench.campaign.record import Record
from bench.processes import ctrl_c_waiting
from companion.errors import ReboundError
from rebound_cli.live.console import with_progress

# Cases handed to a worker at a time: a task costs Dask a millisecond or two, a case takes 50 and more.
CASES_PER_TASK = 8
# How long a scheduler may take to answer before it counts as not there.
CONNECT_TIMEOUT_S = 10
RECORDS_FOLDER = Path("runs") / "campaigns"


class CampaignError(ReboundError):
    """A scheduler that cannot be used."""


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


def run_campaign(campaign: Campaign, workers: Workers, folder: Path = RECORDS_FOLDER) -> Results:
    """Work out every case that the record does not have yet, failed ones again; all results, in the order of cases.

    Raises CampaignError for a scheduler that is not there or has other code than this process.
    """
    record = Record(campaign, folder)
    try:
        known = {number for number, outcome in record.outcomes.items() if outcome.failure is None}
        missing = [(number, case) for number, case in enumerate(campaign.cases) if number not in known]
        if known and missing:
            _say(f"{campaign.name}: going on after {len(known)} of {len(campaign.cases)} cases ({record.path})")
        if missing:
            for outcome in with_progress(_outcomes(campaign, missing, workers), len(missing), campaign.name):
                record.add(outcome)
        return _sorted(record, len(campaign.cases))
    except KeyboardInterrupt:
        _say(f"\n{campaign.name}: broken off after {len(record.outcomes)} cases; the same command goes on from there")
        raise
    finally:
        record.close()


def failures_text(campaign: Campaign, results: Results) -> str:
    """One line a failed case, with what is needed to see it again; empty where there is none."""
    return "\n".join(
        f"{campaign.name}: case {number} failed: {why}; {campaign.cases[number]}"
        for number, why in results.failures.items()
    )


def _outcomes(campaign: Campaign, missing: Sequence[tuple[int, Any]], workers: Workers) -> Iterator[Outcome]:
    """Outcomes as they come, in any order."""
    # Compiled kernels are kept on disk by the first case; two processes would compile them twice.
    first, rest = missing[:1], missing[1:]
    yield from work_out(campaign.work_out, first)
    if not rest:
        return
    logging.getLogger("distributed").setLevel(logging.ERROR)
    with ctrl_c_waiting() as pressed:
        started = _client(workers)
    with started as client:
        if pressed:
            raise KeyboardInterrupt
        _check_versions(client, campaign)
        tasks = [rest[start : start + CASES_PER_TASK] for start in range(0, len(rest), CASES_PER_TASK)]
        futures = {client.submit(work_out, campaign.work_out, task, pure=False): task for task in tasks}
        for future in as_completed(list(futures)):
            task = futures.pop(future)
            if future.status == "finished":
                yield from future.result()
            else:
                # Not the cases' own exceptions, which are outcomes: a worker that died, time and again.
                yield from (Outcome(number, None, f"worker lost: {future.exception()!r}") for number, _ in task)
            future.release()


def _client(workers: Workers) -> Client:
    if workers.scheduler is None:
        # A worker's profile of itself grows by a megabyte every ten seconds of work.
        dask.config.set({"distributed.worker.profile.enabled": False})
        cluster = LocalCluster(
            n_workers=workers.jobs,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",
            silence_logs=50,
        )
        return _LocalClient(cluster)
    try:
        return Client(workers.scheduler, timeout=CONNECT_TIMEOUT_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise CampaignError(
            f"no Dask scheduler answers at {workers.scheduler} ({error}); start one with `dask scheduler`, "
            "or leave --scheduler away"
        ) from error


class _LocalClient(Client):  # type: ignore[misc]
    """A client that takes its cluster down with itself."""

    def __exit__(self, *exception: object) -> None:
        super().__exit__(*exception)
        self.cluster.close()


def _check_versions(client: Client, campaign: Campaign) -> None:
    """The same result whoever computes needs the same code everywhere."""
    versions: dict[str, str] = client.run(code_version, campaign.rooms)
    if not versions:
        raise CampaignError("the Dask scheduler has no workers; start some with `dask worker ADDRESS`")
    for address, version in versions.items():
        if version != campaign.version:
            raise CampaignError(
                f"the worker {address} has version {version} and this is {campaign.version}; install the same on both"
            )


def _sorted(record: Record, cases: int) -> Results:
    """Without what a longer campaign of the same cases has beyond them."""
    ordered = [record.outcomes[number] for number in sorted(record.outcomes) if number < cases]
    return Results(
        {outcome.number: outcome.result for outcome in ordered if outcome.result is not None},
        {outcome.number: outcome.failure for outcome in ordered if outcome.failure is not None},
    )


def _say(text: str) -> None:
    print(text, file=sys.stderr)
