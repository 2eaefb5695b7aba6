"""`bench instructions`: what a packet costs the companion, the same number on a busy machine and on an idle one.

Beside it stands what pymavlink needs to parse the same bytes in the same run: another interpreter's figures compare.
"""

import os
import pickle
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from bench.fly.campaign import Json
from bench.rows.tables import table
from bench.studies.speed import MISSION, now_us_of, recorded
from bench.studies.study import Shown, page_path, write_page
from companion.errors import ReboundError
from companion.mavlink.decode import Decoder
from companion.mavlink.packet import message_id_of
from companion.messages import MessageId
from rebound_cli.inputs.inputs import load_mission_document, mission_from, world_from

ROOT = Path(__file__).parents[2]
# Intervals before the hit: a second of them whole, then so many in which each packet comes by itself, as a UART has it.
SECOND, ALONE = 250, 25
PACKETS = {
    "a quiet IMU sample": MessageId.HIGHRES_IMU,
    "a position": MessageId.LOCAL_POSITION_NED,
    "an attitude": MessageId.ATTITUDE_QUATERNION,
}
FIRST, WHOLE = "a hit's first sample", "a second of flight"
# Of a dump, which has one kind of event.
_COUNT = re.compile(r"^(?:summary|totals): (\d+)$", re.MULTILINE)

Group = Sequence[tuple[int, bytes]]


def run_instructions(options: Namespace) -> int:
    """0 when it is counted, whatever it says. Raises ReboundError without valgrind."""
    page = page_path(options.out, "instructions")
    shown = table(counted())
    write_page(page, "Instructions", options.typed, Shown({"Instructions": shown}))
    print(shown)
    return 0


def counted() -> list[Json]:
    """A second before the first hit of wall.yaml, then packets one by one: medians of a kind, and the hit."""
    document = load_mission_document(MISSION, [], None, None)
    mission = mission_from(document, world_from(document))
    flight = recorded(mission)
    steps = [(now_us_of(interval), said) for interval, said in enumerate(flight.said[: flight.hit + 1])]
    alone_from = flight.hit - ALONE
    packets = [(at, frame) for at, said in steps[alone_from:] for frame, _ in Decoder().feed(said)]
    groups: list[Group] = [steps[alone_from - SECOND : alone_from], *[[packet] for packet in packets]]
    second, *each = _counts(pickle.dumps((mission, steps[: alone_from - SECOND], groups)), len(groups))
    kinds = [(at == steps[-1][0], message_id_of(frame)) for at, frame in packets]
    rows = {
        what: [found for kind, found in zip(kinds, each, strict=True) if kind == (False, message)]
        for what, message in PACKETS.items()
    }
    rows[FIRST] = [found for kind, found in zip(kinds, each, strict=True) if kind == (True, MessageId.HIGHRES_IMU)]
    return [_row(what, found) for what, found in (*rows.items(), (WHOLE, [second]))]


def _row(what: str, found: Sequence[tuple[int, int]]) -> Json:
    peer, own = (statistics.median_low(column) for column in zip(*found, strict=True))
    return {"": what, "Rebound": own, "pymavlink's parse": peer, "ratio": round(own / peer, 2)}


def _counts(recording: bytes, groups: int) -> list[tuple[int, int]]:
    """Of each group the instructions of pymavlink, and of the companion."""
    if shutil.which("valgrind") is None:
        raise ReboundError("valgrind counts the instructions, and is not installed: apt-get install valgrind.")
    with tempfile.TemporaryDirectory() as name:
        folder, place = Path(name), Path(name) / "recording"
        place.write_bytes(recording)
        counter = ["valgrind", "--quiet", "--tool=callgrind", "--dump-before=getppid"]
        program = [sys.executable, "-m", "bench.fly.counted", str(place)]
        environment = os.environ | {"PYTHONHASHSEED": "0", "PYTHONPATH": str(ROOT)}
        subprocess.run(
            [*counter, f"--callgrind-out-file={folder}/out", *program], cwd=folder, env=environment, check=True
        )
        # The first has all that comes before.
        found = [int(_COUNT.findall((folder / f"out.{dump + 2}").read_text())[0]) for dump in range(2 * groups)]
    return list(zip(found[::2], found[1::2], strict=True))
