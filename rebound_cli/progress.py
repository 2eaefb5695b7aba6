"""A bar on the terminal while many flights are flown."""

from collections.abc import Iterable
from typing import TypeVar

Item = TypeVar("Item")


def with_progress(items: Iterable[Item], total: int, what: str = "flights") -> Iterable[Item]:
    """Hand the items on; in a file or a pipe nothing is drawn."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    return track(items, what, total, console=console, disable=not console.is_terminal)
