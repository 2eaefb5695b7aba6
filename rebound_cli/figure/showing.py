"""A flight's picture and page in its folder."""

from pathlib import Path

from rebound_cli.live.console import Console
from rebound_cli.replay.recording import Followed
from rebound_cli.results.run_folder import FIGURE_NAME, REPORT_NAME, TLOG_NAME


def show_flight(folder: Path, followed: Followed | None = None) -> None:
    """The picture is of simulated flights. One that was followed is not decided again. Raises ReboundError, OSError."""
    # A drone that only offers the page never loads what makes it.
    from rebound_cli.report.page import write_page
    from rebound_cli.report.shown_flight import followed_flight, recorded_flight

    # Where nothing was heard, that is what reading it says.
    is_followed = followed is not None and followed.started_at_us
    flight = followed_flight(folder, followed) if followed is not None and is_followed else recorded_flight(folder)
    if flight.scene is not None:
        from rebound_cli.figure.flight import draw_flight

        draw_flight(flight, folder / FIGURE_NAME)
    write_page(flight, folder / REPORT_NAME)


def offer_page(folder: Path, console: Console) -> None:
    """How to make it; of a flight in which nothing was heard there is none."""
    if (folder / TLOG_NAME).stat().st_size > 0:
        console.print(f"A page to look at: rebound report {folder}")
