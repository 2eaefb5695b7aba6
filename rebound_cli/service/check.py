"""`rebound service check`: whether what is installed is what this version installs, and can work."""

import pwd
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from companion.autopilot.setup import PreflightItem, Verdict
from companion.errors import ConfigurationError
from rebound_cli.service.files import UNIT, USER, PlannedFile, ServiceSettings
from rebound_cli.service.system import System, hidden_program

_BY_ID = Path("/dev/serial/by-id")
_AGAIN = "sudo rebound service install"


def findings(
    system: System, plan: Callable[[System], tuple[ServiceSettings, Sequence[PlannedFile]]]
) -> Iterator[PreflightItem]:
    """Of what an installation would write now, beside what is there."""
    if not (system.root / UNIT).exists():
        yield PreflightItem("unit", Verdict.BAD, f"/{UNIT} is not there", f"{_AGAIN} --guard CONFIG --connect URL")
        return
    try:
        settings, planned = plan(system)
    except ConfigurationError as error:
        yield PreflightItem("settings", Verdict.BAD, str(error), f"mend it, then {_AGAIN}")
        return
    yield PreflightItem("settings", Verdict.GOOD, f"{settings.run} at {settings.connect}")
    paths = [(system.root / file.path, file) for file in planned]
    other = [f"/{file.path}" for path, file in paths if not path.exists() or path.read_bytes() != file.text.encode()]
    text = "as this version writes them"
    yield _judged("files", not other, text, f"not {text}: {', '.join(other)}")
    hidden = hidden_program()
    text = f"{hidden} is hidden from the service"
    yield _judged("program", hidden is None, "where the service can read it", text, "install it in /opt/rebound")
    if system.is_running:
        yield _judged("user", USER in {user.pw_name for user in pwd.getpwall()}, USER, f"{USER} is not there")
        if settings.device is not None:
            yield _device(settings.device)


def _judged(item: str, is_good: bool, good: str, bad: str, remedy: str = _AGAIN) -> PreflightItem:
    return PreflightItem(item, Verdict.GOOD, good) if is_good else PreflightItem(item, Verdict.BAD, bad, remedy)


def _device(device: str) -> PreflightItem:
    names = sorted(name for name in _BY_ID.glob("*") if name.resolve() == Path(device).resolve())
    if names and not device.startswith(str(_BY_ID)):
        return PreflightItem("device", Verdict.DOUBTFUL, f"{device} may be another device tomorrow", f"use {names[0]}")
    remedy = "look at the cable, and at raspi-config's serial port"
    return _judged("device", Path(device).exists(), device, f"{device} is not there", remedy)
