"""`rebound logs list` and `show`: the flights on disk."""

from argparse import Namespace

from rebound_cli.flights.kept import flight_named, hits_in, hits_text, kept_flights, runs_folder, simulated_text
from rebound_cli.live.console import console_for
from rebound_cli.results.run_folder import RunFolderError


def run_list(options: Namespace) -> None:
    runs = runs_folder(options.runs)
    flights = kept_flights(runs)
    for flight in flights:
        try:
            lines = flight.event_lines()
            ends = flight.timed_events([*lines[:1], *lines[-1:]])
        except RunFolderError:
            # Of one whose events are damaged there is nothing but its size.
            lines, ends = [], []
        lasted_s = ends[-1][0] if ends else 0.0
        told = f"{flight.name:36} {lasted_s:8.1f} s {flight.size_bytes / 1e6:8.1f} MB"
        print(f"{told}  {hits_text(hits_in(lines)):8}  {flight.end()}")
    total_mb = sum(flight.size_bytes for flight in flights) / 1e6
    many = "" if len(flights) == 1 else "s"
    print(f"{len(flights)} flight{many}, {total_mb:.1f} MB in {runs}.{simulated_text(runs)}")


def run_show(options: Namespace) -> None:
    """Raises RunFolderError."""
    flight = flight_named(runs_folder(options.runs), options.flight)
    lines = flight.event_lines()
    events = flight.timed_events(lines)
    console = console_for(False)
    console.print(f"{flight.name}: {flight.end()}; {hits_text(hits_in(lines))}, {flight.size_bytes / 1e6:.1f} MB")
    for at_s, event in events:
        console.event(at_s, event["kind"], str(event.get("text", "")))
