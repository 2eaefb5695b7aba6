"""The page of a real vehicle's flight: made beside what a person does next, and nowhere in a drone's own time."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from rebound_cli.live.console import Console
from rebound_cli.results.run_folder import REPORT_NAME, TLOG_NAME


def offer_report(folder: Path, console: Console) -> None:
    """Begin to write it where a person sits at a terminal of more than a drone's install, else say how it is made.

    Of a flight in which nothing was heard there is none.
    """
    if (folder / TLOG_NAME).stat().st_size == 0:
        return
    if console.is_terminal and find_spec("matplotlib") is not None:
        nobody = subprocess.DEVNULL
        command = [sys.executable, "-m", "rebound_cli.report.writer", str(folder)]
        subprocess.Popen(command, stdin=nobody, stdout=nobody, stderr=nobody, start_new_session=True)
        console.print(f"{REPORT_NAME} follows.")
    else:
        console.print(f"A page to look at: rebound report {folder}")
