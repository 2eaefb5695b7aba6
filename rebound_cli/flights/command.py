"""`rebound logs list` and `show`: the flights on disk."""

import json
from argparse import Namespace
from typing import Any

from rebound_cli.flights.kept import KeptFlight, flight_named, hits_in, kept_flights, runs_folder, simulated_text
from rebound_cli.live.console import console_for
from rebound_cli.results.run_folder import EVENTS_NAME, RunFolderError, read_records, read_summary


def run_list(options: Namespace) -> int:
    runs = runs_folder(options.runs)
    flights = [overview(flight) for flight in kept_flights(runs)]
    if options.json:
        print(json.dumps(flights, indent=2))
        return 0
    for flight in flights:
        hits = "no hit" if flight["hits"] == 0 else f"{flight['hits']} hit{'s' if flight['hits'] > 1 else ''}"
        size_mb, lasted_s = flight["size_bytes"] / 1e6, flight["duration_s"] or 0.0
        print(f"{flight['name']:36} {lasted_s:8.1f} s {size_mb:8.1f} MB  {hits:8}  {flight['end']}")
    total_mb = sum(flight["size_bytes"] for flight in flights) / 1e6
    many = "" if len(flights) == 1 else "s"
    print(f"{len(flights)} flight{many}, {total_mb:.1f} MB in {runs}.{simulated_text(runs)}")
    return 0


def run_show(options: Namespace) -> int:
    """Raises FlightError, RunFolderError."""
    flight = flight_named(runs_folder(options.runs), options.flight)
    told = overview(flight)
    events = list(read_records(flight.folder / EVENTS_NAME, "".join(flight.event_lines())))
    if options.json:
        print(json.dumps({**told, "summary": read_summary(flight.folder), "events": events}, indent=2))
        return 0
    console = console_for(False)
    console.print(f"{told['name']}: {told['end']}; {told['hits']} hits, {told['size_bytes'] / 1e6:.1f} MB")
    for event in events:
        console.event((event["time_us"] - events[0]["time_us"]) / 1e6, event["kind"], str(event.get("text", "")))
    return 0


def overview(flight: KeptFlight) -> dict[str, Any]:
    """A flight in a line; nothing but its size of one whose events are damaged."""
    try:
        lines = flight.event_lines()
        ends = list(read_records(flight.folder / EVENTS_NAME, "".join([*lines[:1], *lines[-1:]])))
    except RunFolderError:
        lines, ends = [], []
    summary = read_summary(flight.folder)
    end = "cut off" if summary is None else str(summary.get("reason") or summary.get("outcome"))
    return {
        "name": flight.name,
        "begun": flight.begun,
        "duration_s": (ends[-1]["time_us"] - ends[0]["time_us"]) / 1e6 if ends else None,
        "size_bytes": flight.size_bytes,
        "hits": hits_in(lines),
        "end": "being flown" if flight.is_being_flown() else end,
    }
