"""`rebound doctor`: all that somebody needs who is asked for help, in one archive."""

import json
import os
import platform
import shutil
import subprocess
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from companion.errors import ConfigurationError
from rebound_cli.flights.archive import add_flight, new_archive
from rebound_cli.flights.kept import kept_flights, runs_folder
from rebound_cli.live.status import StatusError, ask
from rebound_cli.results.run_folder import read_text, versions
from rebound_cli.service.files import FOLDER

SETTINGS = Path("/", FOLDER)
# What a service's unit and the rule of its device are called.
_SYSTEM_FILES = ("/etc/systemd/system", "rebound*.service"), ("/etc/udev/rules.d", "*rebound*.rules")
# Some hours of a guard that prints a line every five seconds.
_JOURNAL_LINES = 5000
_JOURNAL_WAIT_S = 30.0
# What the kernel says of this machine.
_MACHINE_FILES = ("/proc/cpuinfo", "/proc/meminfo", "/proc/uptime", "/proc/loadavg", "/proc/device-tree/model")


def run_doctor(options: Namespace) -> int:
    """What cannot be had is named in the archive and left out; it fails only where nothing can be written."""
    for file in (*options.config, *([options.preflight] if options.preflight else ())):
        if not file.is_file():
            raise ConfigurationError(f"{file} does not exist: give a file, or leave the option out.")
    runs = runs_folder(options.runs)
    with new_archive(options.out, options.no_position) as archive:
        archive.add_data("versions.json", json.dumps(versions(), indent=2) + "\n")
        archive.add_text("machine.txt", _machine(runs))
        archive.add_text("journal.txt", _journal())
        archive.add_data("status.json", json.dumps(_status(), indent=2) + "\n")
        settings = [*options.config, *sorted(SETTINGS.glob("*.yaml"))]
        for number, file in enumerate(settings, start=1):
            archive.add_data(f"settings/{number}-{file.name}", read_text(file))
        for folder, pattern in _SYSTEM_FILES:
            for file in sorted(Path(folder).glob(pattern)):
                archive.add_text(f"system/{file.name}", read_text(file))
        if options.preflight is not None:
            archive.add_data("preflight.json", read_text(options.preflight))
        flights = kept_flights(runs)[-options.flights :]
        for flight in flights:
            add_flight(archive, flight, "flights/")
    size_mb = options.out.stat().st_size / 1e6
    what = "coordinates are left out" if options.no_position else "flights' coordinates are in it: see --no-position"
    print(f"{options.out}: {size_mb:.1f} MB, {len(flights)} flights; keys are left out, {what}.")
    return 0


def _machine(runs: Path) -> str:
    disk = shutil.disk_usage(runs if runs.is_dir() else Path())
    lines = [
        " ".join(platform.uname()),
        f"disk of the flights: {disk.free / 1e6:.0f} of {disk.total / 1e6:.0f} MB free",
        f"cores: {os.cpu_count()}",
    ]
    for name in _MACHINE_FILES:
        if Path(name).is_file():
            lines += [f"\n{name}", Path(name).read_text(errors="replace").rstrip("\0\n")]
    return "\n".join(lines) + "\n"


def _journal() -> str:
    """Of the services whose names begin with rebound."""
    command = ["journalctl", "--no-pager", "--output=short-iso", f"--lines={_JOURNAL_LINES}", "--unit=rebound*"]
    try:
        done = subprocess.run(command, capture_output=True, timeout=_JOURNAL_WAIT_S, check=False)
    except FileNotFoundError:
        return "journalctl is not installed here\n"
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"journalctl did not answer: {error}\n"
    return (done.stdout + done.stderr).decode(errors="replace")


def _status() -> Mapping[str, Any]:
    try:
        return ask(None)
    except StatusError as error:
        return {"error": str(error)}
