"""`rebound service`: writes the files, has systemd do the rest, and keeps every value that is in /etc/rebound."""

import shutil
import sys
from argparse import Namespace
from pathlib import Path

from companion.errors import ReboundError
from companion.guard.config import GuardConfig
from rebound_cli.inputs import documents
from rebound_cli.inputs.documents import DocumentError, load_document, parse_document, validated
from rebound_cli.inputs.inputs import mission_from
from rebound_cli.preflight.command import show_findings
from rebound_cli.results.run_folder import read_text
from rebound_cli.service import files
from rebound_cli.service.check import findings
from rebound_cli.service.files import FOLDER, SYSUSERS, UDEV, UNIT, UNIT_NAME, PlannedFile, ServiceSettings
from rebound_cli.service.system import System, hidden_program, serial_group

_SETTINGS_NAME, _GUARD_NAME = "service.yaml", "guard.yaml"
# A guard by all its defaults, of which the first to be changed is shown.
_GUARD_TEXT = "# Settings: docs/how-to/guard.md.\nthen: hold\n"
_BOOT = "It runs from the next boot on."
_STARTED = f"""It runs now, and from every boot on: rebound service status
What ran before goes on as it was. Restart it on the ground: sudo systemctl restart {UNIT_NAME}"""
_NOT_STARTED = f"The mission is flown when a person starts it, and never by itself: sudo systemctl start {UNIT_NAME}"


def run_service(options: Namespace, system: System | None = None) -> int:
    """On this computer, or another `system`. Raises DocumentError, ReboundError."""
    system = system or System()
    if options.what == "install":
        return _install(system, options)
    if options.guard is not None or options.mission is not None or options.connect is not None:
        raise ReboundError("--guard, --mission and --connect belong to `rebound service install`.")
    if options.what == "uninstall":
        return _uninstall(system, options.dry_run)
    if options.what == "check":
        return show_findings(list(findings(system, plan)), 10, print)
    return system.call("systemctl", "status", "--no-pager", UNIT_NAME)


def _install(system: System, options: Namespace) -> int:
    settings, planned = plan(system, options.guard, options.mission, options.connect)
    if options.dry_run:
        print("\n".join(f"# /{file.path}\n{file.text}" for file in planned), end="")
        return 0
    system.refuse_if_unfit()
    hidden = hidden_program()
    if hidden is not None:
        text = f"{hidden} is hidden from the service: install Rebound in /opt/rebound (docs/how-to/service.md)."
        raise ReboundError(text)
    for file in planned:
        if not file.is_kept:
            system.write(file.path, file.text)
        otherwise = ", which says otherwise: change it there" if file.says_otherwise else ""
        print(f"{'kept' if file.is_kept else 'wrote'} /{file.path}{otherwise}")
    if settings.device is None:
        (system.root / UDEV).unlink(missing_ok=True)
    is_guard = settings.run == "guard"
    system.told("systemd-sysusers", SYSUSERS.rpartition("/")[2])
    _reload(system)
    # What was a guard and is a mission now is not to begin with the next boot.
    system.told("systemctl", "enable" if is_guard else "disable", UNIT_NAME)
    if is_guard and system.is_running:
        # It is ready when the vehicle is heard: nobody waits for that here.
        system.told("systemctl", "start", "--no-block", UNIT_NAME)
    print(_NOT_STARTED if not is_guard else _STARTED if system.is_running else _BOOT)
    return 0


def plan(
    system: System, guard: Path | None = None, mission: Path | None = None, connect: str | None = None
) -> tuple[ServiceSettings, list[PlannedFile]]:
    """What will hold, and the files of an installation; the unit last: without it nothing else does anything.

    Raises DocumentError for what is wrong in the options, in the files they name, or in /etc/rebound.
    """
    stored = system.root / FOLDER / _SETTINGS_NAME
    document = load_document(stored) if stored.exists() else documents.Document(str(stored))
    settings = validated(ServiceSettings, document, document.data)
    source = guard or mission
    if source is not None:
        document.data["run"] = "mission" if guard is None else "guard"
    if connect is not None:
        document.put_option("--connect", ("connect",), connect)
    asked = validated(ServiceSettings, document, document.data)
    settings = settings if stored.exists() else asked
    planned = [_in_etc(system, _SETTINGS_NAME, asked.text() if asked != settings or not stored.exists() else None)]
    text = None if source is None else read_text(source)
    if text is not None:
        _check_run(asked.run, text, str(source))
    planned.append(_in_etc(system, f"{settings.run}.yaml", text if asked.run == settings.run else None))
    has_clients = _check_run(settings.run, planned[-1].text, f"/{planned[-1].path}")
    planned.append(PlannedFile(SYSUSERS, files.SYSUSERS_TEXT))
    if settings.device is not None:
        planned.append(PlannedFile(UDEV, files.udev_text(settings.device)))
    unit = files.unit_text(settings, sys.executable, system.release(), serial_group(), has_clients)
    return settings, [*planned, PlannedFile(UNIT, unit)]


def _in_etc(system: System, name: str, asked: str | None) -> PlannedFile:
    """A person's file; where there is one already, that one, whatever is asked for now."""
    path = f"{FOLDER}/{name}"
    if (system.root / path).exists():
        stored = read_text(system.root / path)
        return PlannedFile(path, stored, is_kept=True, says_otherwise=asked not in (None, stored))
    if asked is None and name != _GUARD_NAME:
        raise DocumentError(f"/{path}: no such file; give --mission FILE.")
    return PlannedFile(path, asked or _GUARD_TEXT)


def _check_run(kind: str, text: str, name: str) -> bool:
    """The guard's settings or the mission, as the service will read them; whether others reach the vehicle through it.

    Raises DocumentError.
    """
    document = parse_document(text, name)
    if kind == "guard":
        return bool(validated(GuardConfig, document, document.data).between)
    obstacles = document.data.get("obstacles")
    file = obstacles.get("file") if isinstance(obstacles, dict) else None
    if isinstance(file, str) and not Path(file).is_absolute():
        place = document.place_of(("obstacles", "file"))
        raise DocumentError(f"{place}: obstacles.file: the mission is copied to /{FOLDER}; give the file's whole path.")
    if mission_from(document).companion.link.wait:
        place = document.place_of(("companion", "link", "wait"))
        raise DocumentError(f"{place}: companion.link.wait: a service would arm a vehicle whenever it appears.")
    return False


def _uninstall(system: System, is_dry_run: bool) -> int:
    present = [path for path in (SYSUSERS, UDEV, UNIT) if (system.root / path).exists()]
    if not present:
        raise ReboundError("No service of Rebound is installed.")
    if is_dry_run:
        print("\n".join(f"# /{path}" for path in present))
        return 0
    system.refuse_if_unfit()
    if UNIT in present:
        system.told("systemctl", "disable", *(["--now"] if system.is_running else []), UNIT_NAME)
    for path in present:
        (system.root / path).unlink()
        print(f"removed /{path}")
    _reload(system)
    print(f"Settings in /{FOLDER} and flights in {files.STATE_FOLDER} are kept.")
    return 0


def _reload(system: System) -> None:
    if system.is_running:
        system.told("systemctl", "daemon-reload")
        # A container has its devices from outside, and no udev.
        if shutil.which("udevadm") is not None:
            system.told("udevadm", "control", "--reload")
            system.told("udevadm", "trigger", "--subsystem-match=tty")
