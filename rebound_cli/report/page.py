"""`rebound report`: a flight as one file, of its data, our own scripts and two libraries as their makers publish them.

A browser runs nothing in it but the scripts named by their hashes, and loads nothing: the page forbids itself both.
"""

import base64
import hashlib
import html
import json
from argparse import Namespace
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from companion.shell.files import write_whole
from rebound_cli.flights.kept import flight_named, runs_folder
from rebound_cli.inputs.documents import refuse_special
from rebound_cli.report.content import as_text, content, live_content
from rebound_cli.report.shown_flight import ShownFlight, recorded_flight
from rebound_cli.results.run_folder import REPORT_NAME

LIBRARIES = ("three.min.js", "uPlot.iife.min.js")
STYLES = ("assets/uPlot.min.css", "page.css")
# In the order in which they need each other.
SCRIPTS = ("data.js", "charts.js", "scene.js", "player.js", "page.js")
LIVE_SCRIPT = "live.js"


def page(flight: ShownFlight, no_position: bool = False) -> str:
    """The whole file; the same bytes for the same flight."""
    return assembled(content(flight, no_position), SCRIPTS)


def live_page(flight: ShownFlight) -> str:
    """Of a flight that goes on: the page asks whoever serves it, and nobody else, for what comes."""
    return assembled(live_content(flight), (*SCRIPTS, LIVE_SCRIPT), "; connect-src 'self'")


def assembled(data: dict[str, Any], ours: Sequence[str], may: str = "") -> str:
    data["libraries"] = libraries()
    scripts = [file_text(f"assets/{name}") for name in LIBRARIES] + [file_text(name) for name in ours]
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    hashes = " ".join(f"'sha256-{digest}'" for digest in digests)
    return file_text("shell.html").format(
        policy=f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:{may}",
        title=html.escape(f"{data['name']}: {data['sentence']}"),
        style="\n".join(map(file_text, STYLES)),
        body=file_text("page.html"),
        data=as_text(data),
        scripts="\n".join(f"<script>{script}</script>" for script in scripts),
    )


def libraries() -> list[dict[str, Any]]:
    """What is in the page of others, each with its licence's whole text."""
    listed = json.loads(file_text("assets/libraries.json"))
    return [{**one, "licence_text": file_text(f"assets/{one['licence_file']}")} for one in listed]


def file_text(name: str) -> str:
    """Of a file of the page's own, to the byte."""
    return (resources.files(__package__) / "web" / name).read_bytes().decode("utf-8")


def run_report(options: Namespace) -> None:
    """Of a run's folder, into it where no other file is named. Raises ReboundError, OSError."""
    folder = flight_named(runs_folder(options.runs), str(options.flight)).folder
    out = options.out or folder / REPORT_NAME
    refuse_special(out)
    print(f"The report is in {write_page(recorded_flight(folder), out, options.no_position)}")


def write_page(flight: ShownFlight, path: Path, no_position: bool = False) -> Path:
    """Raises OSError."""
    write_whole(path, page(flight, no_position).encode())
    return path
