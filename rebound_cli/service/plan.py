"""Which files an installation writes. What is in /etc/rebound already stays as it is, every value of it."""

import sys
from dataclasses import dataclass
from pathlib import Path

from rebound_cli.documents import DocumentError, Override, apply_override, empty_document, load_document, validated
from rebound_cli.run_folder import read_text
from rebound_cli.service.files import SYSUSERS, UDEV, UNIT, sysusers_text, udev_text, unit_text
from rebound_cli.service.settings import FOLDER, SETTINGS_NAME, ServiceSettings, check_run, settings_text
from rebound_cli.service.system import System

_GUARD_NAME = "guard.yaml"
# A guard by all its defaults, of which the first to be changed is shown.
_GUARD_TEXT = "# Settings: docs/guard.md.\nthen: hold\n"
# What was asked for, beside what is kept.
NEW = ".new"


@dataclass(frozen=True, slots=True)
class PlannedFile:
    """A file below the system's root; a kept one is there already with this text."""

    path: str
    text: str
    is_kept: bool = False


@dataclass(frozen=True, slots=True)
class Plan:
    """The unit comes last: until it is there, nothing else does anything."""

    settings: ServiceSettings
    files: tuple[PlannedFile, ...]
    # In a sentence each: what was asked for and is not done, because a person's settings say otherwise.
    left_aside: tuple[str, ...]


def plan(system: System, guard: Path | None = None, mission: Path | None = None, connect: str | None = None) -> Plan:
    """Raises DocumentError for what is wrong in the options, in the files they name, or in /etc/rebound."""
    stored = system.root / FOLDER / SETTINGS_NAME
    document = load_document(stored) if stored.exists() else empty_document(str(stored))
    settings = validated(ServiceSettings, document, document.data)
    source = guard or mission
    if source is not None:
        document.data["run"] = "mission" if guard is None else "guard"
    if connect is not None:
        apply_override(document, Override(f"--connect {connect}", ("connect",), connect))
    asked = validated(ServiceSettings, document, document.data)
    is_new = not stored.exists()
    settings = asked if is_new else settings
    files = _in_etc(system, SETTINGS_NAME, settings_text(asked) if is_new or asked != settings else None)
    for kind in sorted({asked.run, settings.run}):
        text = None
        if kind == asked.run and source is not None:
            text = read_text(source)
            check_run(kind, text, str(source))
        files += _in_etc(system, f"{kind}.yaml", text)
        check_run(kind, files[-1].text, f"/{files[-1].path}")
    left_aside = [
        f"/{file.path.removesuffix(NEW)} is kept. What you asked for is beside it, as {Path(file.path).name}."
        for file in files
        if file.path.endswith(NEW)
    ]
    return Plan(settings, (*files, *_following(settings, system)), tuple(left_aside))


def _in_etc(system: System, name: str, asked: str | None) -> list[PlannedFile]:
    """A person's file; where there is one already, that one, and beside it what is asked for now."""
    path = f"{FOLDER}/{name}"
    if (system.root / path).exists():
        stored = read_text(system.root / path)
        beside = [] if asked in (None, stored) else [PlannedFile(path + NEW, str(asked))]
        return [*beside, PlannedFile(path, stored, is_kept=True)]
    if asked is None and name != _GUARD_NAME:
        raise DocumentError(f"/{path}: no such file; give --mission FILE.")
    return [PlannedFile(path, asked or _GUARD_TEXT)]


def _following(settings: ServiceSettings, system: System) -> list[PlannedFile]:
    """Whatever follows from the settings: written anew each time."""
    device = settings.device
    unit = unit_text(settings, sys.executable, system.release(), system.serial_group())
    return [
        PlannedFile(SYSUSERS, sysusers_text()),
        *([] if device is None else [PlannedFile(UDEV, udev_text(device))]),
        PlannedFile(UNIT, unit),
    ]
