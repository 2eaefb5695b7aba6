"""What `bench instructions` counts: packets read by pymavlink, and stepped by the companion. It imports nothing else.

Callgrind writes its count down at each call of getppid.
"""

import gc
import os
import pickle
import sys
from pathlib import Path

from pymavlink.dialects.v20 import development as dialect

from companion.companion import Companion


def count(recording: Path) -> None:
    """A flight goes on from its beginning; of each group first the peer's part is counted, then the companion's."""
    mission, before, groups = pickle.loads(recording.read_bytes())
    companion, link = Companion(mission), dialect.MAVLink(None)
    companion.confirm_plan()
    # As in flight: nothing is collected.
    gc.disable()
    for now_us, said in before:
        companion.step(said, now_us)
    for group in groups:
        os.getppid()
        for _, said in group:
            link.parse_buffer(said)
        os.getppid()
        for now_us, said in group:
            companion.step(said, now_us)
    os.getppid()


if __name__ == "__main__":
    count(Path(sys.argv[1]))
