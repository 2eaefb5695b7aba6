"""What a campaign is: cases by number, a function that works one out, and the key under which results are kept."""

import gc
import hashlib
import importlib
import inspect
import json
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from rebound_cli import __version__

Json = dict[str, Any]

# Half of a SHA-256 in hexadecimal digits would do against accidents; this much is still readable in a file's name.
KEY_DIGITS = 16


@dataclass(frozen=True, slots=True)
class Campaign:
    """A name, the parameters from which all cases follow, the cases, and what is done with each.

    `work_out` is a function of a module (workers import it) from a case to what JSON can hold. A case carries its own
    seed, so that it does not matter which worker gets it, or when.
    """

    name: str
    parameters: Mapping[str, Any]
    cases: Sequence[Any]
    work_out: Callable[[Any], Json]
    uses: tuple[str, ...] = ()
    """Packages of `bench` on which results depend beside the programs and the function's own."""

    @property
    def rooms(self) -> tuple[str, ...]:
        """Modules in the folders of which all code that decides a case's result is."""
        return ("companion", "sim_vehicle", "rebound_cli", self.work_out.__module__, *self.uses)

    @property
    def version(self) -> str:
        return code_version(self.rooms)

    @property
    def key(self) -> str:
        """The same for the same parameters and version, whatever the machine and the number of workers."""
        text = json.dumps([self.name, dict(self.parameters), self.version], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:KEY_DIGITS]


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of one case: its result, or why there is none."""

    number: int
    result: Json | None
    failure: str | None = None


def work_out(function: Callable[[Any], Json], numbered: Sequence[tuple[int, Any]]) -> list[Outcome]:
    """The outcomes of some cases. An exception is that case's outcome and does not stop the next."""
    # A case makes millions of small objects and hardly a cycle: looking for cycles all the time is a third of its cost.
    gc.disable()
    try:
        return [_outcome(function, number, case) for number, case in numbered]
    finally:
        gc.enable()


def _outcome(function: Callable[[Any], Json], number: int, case: Any) -> Outcome:
    try:
        return Outcome(number, function(case))
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        return Outcome(number, None, f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})")


def code_version(rooms: Sequence[str]) -> str:
    """Release and a digest of the code in the folders of these modules."""
    digest = hashlib.sha256()
    for folder in [_folder(importlib.import_module(room)) for room in rooms]:
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".py", ".yaml"):
                digest.update(path.relative_to(folder).as_posix().encode())
                digest.update(path.read_bytes())
    return f"{__version__}+{digest.hexdigest()[:KEY_DIGITS]}"


def _folder(module: ModuleType) -> Path:
    return Path(inspect.getfile(module)).parent
