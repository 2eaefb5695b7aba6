"""Files that mean harm, or are half there: a sentence in bounded time, and nothing lost."""

import json
import random
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bench.fly.campaign import Json
from companion.errors import ReboundError
from companion.shell.tlog import TlogWriter, read_tlog
from rebound_cli.inputs import load_mission_document, mission_from, world_from

# As long as a person waits for `rebound check`, on a computer that has other things to do.
SECONDS_MOST = 60.0


@dataclass(frozen=True, slots=True)
class FileFault:
    """`write` puts the file into the folder; `read` opens it as the product does, and raises ReboundError."""

    name: str
    injected: str
    write: Callable[[Path, random.Random], Path]
    read: Callable[[Path], None]
    is_refused: bool | None = True
    """None: either will do, as long as it is said."""
    most_tries: int = 50

    @property
    def expected(self) -> "FileFault":
        return self

    def text(self) -> str:
        """What is expected."""
        words = {
            True: "refused in one sentence",
            False: "all whole packets read",
            None: "read or refused in one sentence",
        }
        return f"{words[self.is_refused]} within {SECONDS_MOST:.0f} s"


def tried(fault: FileFault, seed: int) -> Json:
    """What became of reading one."""
    with tempfile.TemporaryDirectory() as folder:
        path = fault.write(Path(folder), random.Random(f"{fault.name} {seed}"))
        began_s, complaints, outcome = time.process_time(), [], "read"
        try:
            fault.read(path)
        except ReboundError as error:
            outcome = "refused"
            complaints += [] if str(error).strip() else ["refused without a word"]
        except Exception as error:
            outcome = "broken"
            complaints.append(f"{type(error).__name__}: {error}")
        seconds = time.process_time() - began_s
    complaints += [f"took {seconds:.0f} s of processor time"] if seconds > SECONDS_MOST else []
    complaints += ["taken as good"] if fault.is_refused and outcome == "read" else []
    complaints += ["refused"] if fault.is_refused is False and outcome == "refused" else []
    return {"complaints": complaints, "outcome": outcome, "seconds": round(seconds, 2)}


def _mission(path: Path) -> None:
    document = load_mission_document(path, [])
    mission_from(document, world_from(document))


def _written(folder: Path, text: str | bytes, name: str = "mission.yaml") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def _bomb(folder: Path, chance: random.Random) -> Path:
    width, depth = chance.randint(5, 12), chance.randint(6, 14)
    lines = [f"a0: &a0 [{', '.join(['x'] * width)}]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * width)}]" for n in range(1, depth)]
    return _written(folder, "\n".join(lines) + "\n")


def _huge(folder: Path, chance: random.Random) -> Path:
    points = ",".join(f"[{n % 5},{n % 7},-1.5]" for n in range(1_000_000))
    return _written(folder, f"name: huge\nitems: [takeoff: {{height_m: 1}}, path: {{points_ned_m: [{points}]}}]\n")


def _long(folder: Path, chance: random.Random) -> Path:
    """Under the limit of a megabyte, and valid but for the fence."""
    items = "\n".join(f"  - go_to: {{position_ned_m: [{n}, 0, -1.5]}}" for n in range(chance.randint(2000, 4000)))
    return _written(folder, f"name: long\nitems:\n  - takeoff: {{height_m: 1.5}}\n{items}\n")


def _deep(folder: Path, chance: random.Random) -> Path:
    depth = chance.randint(500, 50_000)
    return _written(folder, "name: deep\nitems: " + "[" * depth + "]" * depth + "\n")


def _noise(folder: Path, chance: random.Random) -> Path:
    return _written(folder, chance.randbytes(chance.randint(1, 20_000)))


def _spoiled(folder: Path, chance: random.Random) -> Path:
    """A good mission with ten bytes changed somewhere: it may still be one."""
    text = bytearray((Path(__file__).parents[2] / "missions" / "wall.yaml").read_bytes())
    for _ in range(10):
        text[chance.randrange(len(text))] = chance.randrange(256)
    return _written(folder, bytes(text))


def _obstacles(folder: Path, chance: random.Random) -> Path:
    whole = json.dumps({"version": 1, "patches": [{"position_ned_m": [1, 2, -1], "normal_ned": [1, 0, 0]}]})
    _written(folder, whole[: chance.randrange(1, len(whole) - 1)], "known.json")
    return _written(folder, "name: m\nitems: [takeoff: {height_m: 1}, land: {}]\nobstacles: {file: known.json}\n")


def _torn(folder: Path, chance: random.Random) -> Path:
    """A log of which a kill or a full disk has kept a part."""
    path = folder / "flight.tlog"
    writer = TlogWriter(path)
    frame = b"\xfd\x09\x00\x00\x00\x01\x01\x00\x00\x00" + bytes(9) + b"\x00\x00"
    writer.write(1_600_000_000_000_000, [frame] * 1000)
    writer.close()
    content = path.read_bytes()
    at = chance.randrange(100, len(content))
    # Cut at random, or a hole of zeros in it.
    path.write_bytes(content[:at] if chance.random() < 0.5 else content[:at] + bytes(50) + content[at + 50 :])
    return path


def _tlog(path: Path) -> None:
    whole = path.stat().st_size // (8 + 21)
    found = sum(1 for _ in read_tlog(path))
    if found < whole - 4:
        raise AssertionError(f"{found} of {whole} packets read")


FAULTS = (
    FileFault("YAML bomb", "aliases of aliases: up to 12^14 values in a kilobyte", _bomb, _mission),
    FileFault("10^6 points", "a mission of a million points, 12 MB", _huge, _mission, most_tries=2),
    FileFault("3,000 items", "a long mission, most of it outside the fence", _long, _mission, most_tries=2),
    FileFault("deep nesting", "up to 50,000 brackets", _deep, _mission, most_tries=5),
    FileFault("noise as mission", "up to 20 kB of random bytes", _noise, _mission),
    FileFault("mission spoiled", "ten bytes of wall.yaml changed", _spoiled, _mission, None),
    FileFault("obstacle file cut", "the file of known obstacles ends in the middle", _obstacles, _mission),
    FileFault("tlog torn", "cut at random, or a hole of zeros", _torn, _tlog, False),
)
