"""A flight's picture and page, made by a process of its own: the person has the prompt back meanwhile."""

import pickle
import subprocess
import sys
import tempfile
from typing import Any


def draw_later(*flight: Any) -> None:
    """What `draw_flight` takes. Returns at once; each file is there when it is whole."""
    # Without a name: nobody else can put anything in its place.
    with tempfile.TemporaryFile() as file:
        pickle.dump(flight, file)
        file.seek(0)
        nobody = subprocess.DEVNULL
        command = [sys.executable, "-m", "rebound_cli.figure.later"]
        subprocess.Popen(command, stdin=file, stdout=nobody, stderr=nobody, start_new_session=True)


if __name__ == "__main__":
    from rebound_cli.figure.flight import draw_flight
    from rebound_cli.report.writer import write_report

    flight = pickle.load(sys.stdin.buffer)
    draw_flight(*flight)
    write_report(flight[0])
