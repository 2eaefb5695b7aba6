"""`rebound service`: writes the files, and has systemd do the rest."""

import shutil
from argparse import Namespace

from rebound_cli.service.check import run_check
from rebound_cli.service.files import STATE_FOLDER, SYSUSERS, UDEV, UNIT, UNIT_NAME
from rebound_cli.service.plan import plan
from rebound_cli.service.settings import FOLDER
from rebound_cli.service.system import ServiceError, System, hidden_program

_BOOT = "It runs from the next boot on."
_STARTED = f"""It runs now, and from every boot on: rebound service status
What ran before goes on as it was. Restart it on the ground: sudo systemctl restart {UNIT_NAME}"""
_NOT_STARTED = f"The mission is flown when a person starts it, and never by itself: sudo systemctl start {UNIT_NAME}"


def run_service(options: Namespace) -> int:
    """Raises DocumentError, ServiceError."""
    return run_on(System(), options)


def run_on(system: System, options: Namespace) -> int:
    if options.what == "install":
        return _install(system, options)
    if options.guard is not None or options.mission is not None or options.connect is not None:
        raise ServiceError("--guard, --mission and --connect belong to `rebound service install`.")
    if options.what == "uninstall":
        return _uninstall(system, options.dry_run)
    if options.what == "check":
        return run_check(system)
    return system.call("systemctl", "status", "--no-pager", UNIT_NAME)


def _install(system: System, options: Namespace) -> int:
    planned = plan(system, options.guard, options.mission, options.connect)
    if options.dry_run:
        print("\n".join(f"# /{file.path}\n{file.text}" for file in planned.files), end="")
        return 0
    system.refuse_if_unfit()
    hidden = hidden_program()
    if hidden is not None:
        text = f"{hidden} is hidden from the service: install Rebound in /opt/rebound (docs/companion-computer.md)."
        raise ServiceError(text)
    for file in planned.files:
        if not file.is_kept:
            system.write(file.path, file.text)
        print(f"{'kept' if file.is_kept else 'wrote'} /{file.path}")
    if planned.settings.device is None:
        (system.root / UDEV).unlink(missing_ok=True)
    is_guard = planned.settings.run == "guard"
    system.told("systemd-sysusers", *system.root_option(), SYSUSERS.rpartition("/")[2])
    _reload(system)
    # What was a guard and is a mission now is not to begin with the next boot.
    system.told("systemctl", *system.root_option(), "enable" if is_guard else "disable", UNIT_NAME)
    if is_guard and system.is_running:
        # It is ready when the vehicle is heard: nobody waits for that here.
        system.told("systemctl", "start", "--no-block", UNIT_NAME)
    for sentence in planned.left_aside:
        print(sentence)
    print(_NOT_STARTED if not is_guard else _STARTED if system.is_running else _BOOT)
    return 0


def _uninstall(system: System, is_dry_run: bool) -> int:
    present = [path for path in (SYSUSERS, UDEV, UNIT) if (system.root / path).exists()]
    if not present:
        raise ServiceError("No service of Rebound is installed.")
    if is_dry_run:
        print("\n".join(f"# /{path}" for path in present))
        return 0
    system.refuse_if_unfit()
    if UNIT in present:
        now = ["--now"] if system.is_running else []
        system.told("systemctl", *system.root_option(), "disable", *now, UNIT_NAME)
    for path in present:
        (system.root / path).unlink()
        print(f"removed /{path}")
    _reload(system)
    print(f"Settings in /{FOLDER} and flights in {STATE_FOLDER} are kept.")
    return 0


def _reload(system: System) -> None:
    if system.is_running:
        system.told("systemctl", "daemon-reload")
        # A container has its devices from outside, and no udev.
        if shutil.which("udevadm") is not None:
            system.told("udevadm", "control", "--reload")
            system.told("udevadm", "trigger", "--subsystem-match=tty")
