"""`rebound service check`: whether what is installed is what this version installs, and can work."""

import pwd
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeAlias

from companion.autopilot.setup import PreflightItem, Verdict
from companion.errors import ConfigurationError
from rebound_cli.preflight.command import show_findings
from rebound_cli.service.files import UNIT, UNIT_NAME, USER, PlannedFile, ServiceSettings
from rebound_cli.service.system import System, answer, hidden_program

# systemd-analyze's scale has 10 for a service that may do everything; it calls up to 2 safe or nearly so.
MOST_EXPOSED = 2.0
_BY_ID = Path("/dev/serial/by-id")
_AGAIN = "sudo rebound service install"


Plan: TypeAlias = Callable[[System], tuple[ServiceSettings, list[PlannedFile]]]


def run_check(system: System, plan: Plan) -> int:
    """Print the findings; 0 when none of them is bad."""
    found = list(_findings(system, plan))
    show_findings(found, 10, print)
    return 1 if any(finding.verdict is Verdict.BAD for finding in found) else 0


def _judged(item: str, is_good: bool, good: str, bad: str, remedy: str = _AGAIN) -> PreflightItem:
    return PreflightItem(item, Verdict.GOOD, good) if is_good else PreflightItem(item, Verdict.BAD, bad, remedy)


def _findings(system: System, plan: Plan) -> Iterator[PreflightItem]:
    unit = system.root / UNIT
    if not unit.exists():
        yield PreflightItem("unit", Verdict.BAD, f"/{UNIT} is not there", f"{_AGAIN} --guard CONFIG --connect URL")
        return
    try:
        settings, planned = plan(system)
    except ConfigurationError as error:
        yield PreflightItem("settings", Verdict.BAD, str(error), f"mend it, then {_AGAIN}")
        return
    yield PreflightItem("settings", Verdict.GOOD, f"{settings.run} at {settings.connect}")
    there = {file: system.root / file.path for file in planned}
    other = [
        f"/{file.path}"
        for file, path in there.items()
        if not path.exists() or path.read_text(encoding="utf-8") != file.text
    ]
    text = "as this version writes them"
    yield _judged("files", not other, text, f"not {text}: {', '.join(other)}")
    hidden = hidden_program()
    text = f"{hidden} is hidden from the service"
    yield _judged("program", hidden is None, "where the service can read it", text, "install it in /opt/rebound")
    if system.is_running:
        yield _judged("user", USER in {user.pw_name for user in pwd.getpwall()}, USER, f"{USER} is not there")
        if settings.device is not None:
            yield _device(settings.device)
    yield from analysed(unit.read_text(encoding="utf-8"))


def _device(device: str) -> PreflightItem:
    names = sorted(name for name in _BY_ID.glob("*") if name.resolve() == Path(device).resolve())
    if names and not device.startswith(str(_BY_ID)):
        return PreflightItem("device", Verdict.DOUBTFUL, f"{device} may be another device tomorrow", f"use {names[0]}")
    remedy = "look at the cable, and at raspi-config's serial port"
    return _judged("device", Path(device).exists(), device, f"{device} is not there", remedy)


def analysed(unit: str) -> Iterator[PreflightItem]:
    """What systemd-analyze says of the unit, offline."""
    if shutil.which("systemd-analyze") is None:
        yield PreflightItem("unit", Verdict.DOUBTFUL, "not looked at: there is no systemd-analyze here")
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, UNIT_NAME)
        file.write_text(unit, encoding="utf-8")
        said, code = answer("systemd-analyze", "verify", str(file))
        # It exits with 0 where it complains of a line that it leaves out.
        yield _judged("unit", code == 0 and not said, "in order", said.partition("\n")[0] or "not in order")
        threshold = f"--threshold={MOST_EXPOSED * 10:.0f}"
        said, code = answer("systemd-analyze", "security", "--offline=true", "--no-pager", threshold, str(file))
        exposure = said.rpartition("→ ")[2].rpartition(": ")[2] or "unknown"
        yield _judged("exposure", code == 0, exposure, exposure)
