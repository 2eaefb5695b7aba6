"""Many flights on several processes of this machine."""

import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import TypeVar

from rebound_cli.live.console import with_progress

Item = TypeVar("Item")
Result = TypeVar("Result")


@contextmanager
def ctrl_c_waiting() -> Iterator[list[int]]:
    """Meanwhile Ctrl-C is only noted, and the processes that are started never hear of it.

    It reaches every process of the terminal; workers that hear it each print a traceback. They inherit what is blocked.
    """
    pressed: list[int] = []
    # It unblocks the signal when it starts, which is with the first worker otherwise.
    resource_tracker.ensure_running()
    before = signal.signal(signal.SIGINT, lambda number, _: pressed.append(number))
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield pressed
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.signal(signal.SIGINT, before)


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
