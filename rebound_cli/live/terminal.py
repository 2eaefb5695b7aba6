"""A terminal: what has happened scrolls by above one region that is drawn anew, with the state now."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TextIO

from rich.console import Console as RichConsole
from rich.console import RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text


class _Rich(RichConsole):
    def on_broken_pipe(self) -> None:
        """Rich would end the program here; a flight goes on without its terminal."""
        raise BrokenPipeError


class Terminal:
    """Drawn by rich, without markup: what is told holds brackets of its own."""

    def __init__(self, stream: TextIO) -> None:
        self._rich = _Rich(file=stream, highlight=False, markup=False, emoji=False)
        self._live = self._new_region()
        self._error: OSError | None = None

    def _new_region(self) -> Live:
        return Live(
            console=self._rich, auto_refresh=False, transient=True, redirect_stdout=False, redirect_stderr=False
        )

    def print(self, text: str) -> None:
        self._draw(Text(text))

    def event(self, time_s: float, kind: str, text: str, stands_out: bool) -> None:
        row = Table.grid(padding=(0, 2))
        row.add_column(justify="right", width=11, no_wrap=True)
        row.add_column(width=10, no_wrap=True)
        row.add_row(f"{time_s:.3f} s", kind, text, style="bold red" if stands_out else "")
        self._draw(row)

    def state(self, fields: Sequence[tuple[str, str]]) -> None:
        rows = Table.grid(padding=(0, 1))
        for name, text in fields:
            rows.add_row(Text(f"  {name}", "dim"), text)
        self._show(rows)

    def ask(self, question: str) -> None:
        self.close()
        self._draw(question, end="")

    def close(self) -> None:
        """Take the region away; the next state brings one back."""
        self._live.stop()
        self._live = self._new_region()

    def _show(self, region: RenderableType) -> None:
        with self._unless_gone():
            self._live.start()
            self._live.update(region, refresh=True)

    def _draw(self, what: RenderableType, end: str = "\n") -> None:
        with self._unless_gone():
            self._rich.print(what, end=end)

    @contextmanager
    def _unless_gone(self) -> Iterator[None]:
        """A terminal that is gone stays gone; rich would keep what it could not write, and try it all again."""
        if self._error is not None:
            raise self._error
        try:
            yield
        except OSError as error:
            self._error = error
            raise
