"""One archive to hand over: never a signing key, and on request no place where a vehicle was."""

import io
import json
import re
import tarfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from rebound_cli.flights.kept import KeptFlight
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import read_text, whole_lines

# The names of all quantities end in frame and unit: these are the places.
_PLACE_KEYS = re.compile(r".*(_ned_m|_ne_m|latitude_deg|longitude_deg|altitude_m)|obstacles|polygon.*")
# In texts: [north, east, down], and a console's line of the state.
_PLACES = re.compile(r"\[-?\d[\d.]*(?:, -?\d[\d.]*)+\]|(?<=position )[-+]\d[\d.]* [-+]\d[\d.]* [-+]\d[\d.]* m")
# As `rebound key new` writes one.
_KEY = re.compile(r"\b[0-9a-fA-F]{64}\b")


@dataclass(frozen=True, slots=True)
class Archive:
    """A tar.gz that is being written."""

    tar: tarfile.TarFile
    no_position: bool

    def add_text(self, name: str, text: str) -> None:
        self._add(name, _PLACES.sub("[left out]", text) if self.no_position else text)

    def add_data(self, name: str, text: str) -> None:
        """By the name's end JSON, lines of JSON, or YAML."""
        if not self.no_position:
            self._add(name, text)
            return
        try:
            if name.endswith(".jsonl"):
                kept = "".join(json.dumps(without_places(json.loads(line))) + "\n" for line in text.splitlines())
            elif name.endswith(".json"):
                kept = json.dumps(without_places(json.loads(text)), indent=2) + "\n"
            else:
                kept = yaml.safe_dump(without_places(yaml.safe_load(text)), sort_keys=False, allow_unicode=True)
        except (ValueError, yaml.YAMLError):
            kept = "left out: damaged, so its coordinates cannot be told from the rest\n"
        self._add(name, kept)

    def _add(self, name: str, text: str) -> None:
        content = _KEY.sub("(key left out)", text).encode()
        entry = tarfile.TarInfo(name)
        entry.size, entry.mtime = len(content), int(time.time())
        self.tar.addfile(entry, io.BytesIO(content))


@contextmanager
def new_archive(path: Path, no_position: bool) -> Iterator[Archive]:
    """Whole when the `with` ends; where that fails, nothing is left of it."""
    unfinished = path.with_name(f"{path.name}.part")
    try:
        with tarfile.open(unfinished, "w:gz") as tar:
            yield Archive(tar, no_position)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def add_flight(archive: Archive, flight: KeptFlight, below: str) -> None:
    """Its folder, below that folder of the archive. Raises RunFolderError.

    Without coordinates a few files are left: packets, obstacles, pictures and missions are little else than places.
    """
    for file in sorted(flight.folder.iterdir()):
        name = f"{below}{flight.name}/{file.name}"
        if not archive.no_position:
            # As long as it is now: the present flight goes on meanwhile.
            archive.tar.add(file, name, recursive=False)
        elif file.name in (run_folder.EVENTS_NAME, run_folder.INPUTS_NAME):
            archive.add_data(name, whole_lines(read_text(file)))
        elif file.name in (run_folder.SUMMARY_NAME, run_folder.GUARD_NAME, run_folder.VERSIONS_NAME):
            archive.add_data(name, read_text(file))


def without_places(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: without_places(value) for key, value in data.items() if not _PLACE_KEYS.fullmatch(str(key))}
    if isinstance(data, list):
        return [without_places(value) for value in data]
    return _PLACES.sub("[left out]", data) if isinstance(data, str) else data
