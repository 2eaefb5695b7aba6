"""A recorded flight as one file for another program."""

import io
from pathlib import Path

from companion.shell.files import write_whole
from rebound_cli.export.ulog import new_ulog
from rebound_cli.logs.reader import read_telemetry
from rebound_cli.report.shown_flight import recorded_flight
from rebound_cli.run_folder import TLOG_NAME


def write_flight(folder: Path, kind: str, out: Path) -> None:
    """A run's folder as .mcap or .ulg. Raises ReboundError, OSError."""
    flight, log = recorded_flight(folder), read_telemetry(folder / TLOG_NAME)
    content = io.BytesIO()
    if kind == "mcap":
        from rebound_cli.export.foxglove import write_mcap

        write_mcap(flight, log, content)
    else:
        content.write(new_ulog(flight, log))
    write_whole(out, content.getvalue())
