"""A flight's page in its folder, and while it is flown."""

import os
import subprocess
import sys
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shlex import quote
from threading import Thread

from companion.errors import ReboundError
from rebound_cli.live.console import Console
from rebound_cli.results.run_folder import REPORT_NAME, TLOG_NAME


def show_flight(folder: Path, console: Console) -> None:
    """Write its page; Ctrl-C leaves it out. Raises OSError."""
    try:
        # A drone that only offers the page never loads what makes it.
        from rebound_cli.report.page import write_page
        from rebound_cli.report.shown_flight import recorded_flight

        write_page(recorded_flight(folder), folder / REPORT_NAME)
    except KeyboardInterrupt:
        offer_page(folder, console)
    except ReboundError as error:
        console.print(f"\nNo {REPORT_NAME}: {error}")


@contextmanager
def watched_page(folder: Path, console: Console, is_to_open: bool) -> Iterator[None]:
    """Until the flight is over a process of its own serves its page, if that is to be opened; says where it is."""
    if not is_to_open:
        console.print(f"Run folder {folder}/; to watch the flight in a browser: rebound watch {quote(str(folder))}")
        yield
        return
    command = [sys.executable, "-m", "rebound_cli", "watch", str(folder)]
    nobody, pipe = subprocess.DEVNULL, subprocess.PIPE
    with subprocess.Popen(command, stdin=nobody, stdout=pipe, text=True, start_new_session=True) as server:
        try:
            assert server.stdout is not None, "it is piped"
            address = server.stdout.readline().removeprefix(f"{folder}: ").split(" ")[0]
            console.print(f"Run folder {folder}/; the flight in a browser: {address}")
            # One in the terminal would take that from the flight; and some are waited for until they are closed.
            has_desktop = not {"DISPLAY", "WAYLAND_DISPLAY"}.isdisjoint(os.environ)
            if has_desktop or sys.platform in ("darwin", "win32"):
                Thread(target=webbrowser.open, args=(address,), daemon=True).start()
            yield
        finally:
            server.terminate()


def offer_page(folder: Path, console: Console) -> None:
    """How to make it; of a flight in which nothing was heard there is none."""
    if (folder / TLOG_NAME).stat().st_size > 0:
        console.print(f"A page to look at: rebound report {quote(str(folder))}")
