"""Many flights on several processes of this machine."""

import multiprocessing
from collections.abc import Callable, Sequence
from typing import TypeVar

from rebound_cli.interrupts import ctrl_c_waiting
from rebound_cli.progress import with_progress

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_processes(work: Callable[[Item], Result], items: Sequence[Item], jobs: int) -> list[Result]:
    """The results in the order of the items, whichever is done first. Raises KeyboardInterrupt on Ctrl-C."""
    # Compiled kernels are in the cache after one flight; two processes would compile them twice.
    results = [work(items[0])]
    with ctrl_c_waiting() as pressed:
        pool = multiprocessing.get_context("spawn").Pool(jobs)
    with pool:
        if pressed:
            raise KeyboardInterrupt
        results.extend(with_progress(pool.imap(work, items[1:]), len(items) - 1))
    return results
