"""A bar on the terminal while many flights are flown."""

import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

Item = TypeVar("Item")

WIDTH = 40


def with_progress(items: Iterable[Item], total: int, what: str = "flights") -> Iterator[Item]:
    """Hand the items on; in a file or a pipe nothing is drawn."""
    is_terminal = sys.stderr.isatty()
    for done, item in enumerate(items, start=1):
        if is_terminal:
            filled = WIDTH * done // total
            sys.stderr.write(f"\r[{'#' * filled}{'.' * (WIDTH - filled)}] {done}/{total} {what}")
            sys.stderr.flush()
        yield item
    if is_terminal:
        sys.stderr.write("\n")
