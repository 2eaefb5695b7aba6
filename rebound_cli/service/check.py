"""`rebound service check`: whether what is installed is what this version installs, and can work."""

import pwd
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from companion.errors import ConfigurationError
from companion.preflight import Finding, Verdict
from rebound_cli.service.files import UNIT, UNIT_NAME, USER
from rebound_cli.service.plan import Plan, plan
from rebound_cli.service.system import System, hidden_program

# systemd-analyze's scale has 10 for a service that may do everything; it calls up to 2 safe or nearly so.
MOST_EXPOSED = 2.0
_BY_ID = Path("/dev/serial/by-id")
_AGAIN = "sudo rebound service install"


def run_check(system: System) -> int:
    """Print the findings; 0 when none of them is bad."""
    found = list(_findings(system))
    for finding in found:
        print(f"  {finding.verdict.value:4}  {finding.item:10} {finding.found}")
        if finding.remedy:
            print(f"        {'':10} -> {finding.remedy}")
    return 1 if any(finding.verdict is Verdict.BAD for finding in found) else 0


def _findings(system: System) -> Iterator[Finding]:
    if not (system.root / UNIT).exists():
        yield Finding("unit", Verdict.BAD, f"/{UNIT} is not there", f"{_AGAIN} --guard CONFIG --connect URL")
        return
    try:
        planned = plan(system)
    except ConfigurationError as error:
        yield Finding("settings", Verdict.BAD, str(error), f"mend it, then {_AGAIN}")
        return
    yield Finding("settings", Verdict.GOOD, f"{planned.settings.run} at {planned.settings.connect}")
    yield _files(planned, system)
    yield _program()
    if system.is_running:
        yield _user()
        if planned.settings.device is not None:
            yield _device(planned.settings.device)
    yield from analysed(system, (system.root / UNIT).read_text(encoding="utf-8"))


def _files(planned: Plan, system: System) -> Finding:
    other = [
        f"/{file.path}"
        for file in planned.files
        if not (system.root / file.path).exists() or (system.root / file.path).read_text(encoding="utf-8") != file.text
    ]
    if other:
        return Finding("files", Verdict.BAD, f"not as this version writes them: {', '.join(other)}", _AGAIN)
    return Finding("files", Verdict.GOOD, "as this version writes them")


def _program() -> Finding:
    hidden = hidden_program()
    if hidden is not None:
        return Finding("program", Verdict.BAD, f"{hidden} is hidden from the service", "install it in /opt/rebound")
    return Finding("program", Verdict.GOOD, "where the service can read it")


def _user() -> Finding:
    try:
        pwd.getpwnam(USER)
    except KeyError:
        return Finding("user", Verdict.BAD, f"{USER} is not there", _AGAIN)
    return Finding("user", Verdict.GOOD, USER)


def _device(device: str) -> Finding:
    if not Path(device).exists():
        return Finding(
            "device", Verdict.BAD, f"{device} is not there", "look at the cable, and at raspi-config's serial port"
        )
    names = sorted(name for name in _BY_ID.glob("*") if name.resolve() == Path(device).resolve())
    if names and not device.startswith(str(_BY_ID)):
        return Finding("device", Verdict.DOUBTFUL, f"{device} may be another device tomorrow", f"use {names[0]}")
    return Finding("device", Verdict.GOOD, device)


def analysed(system: System, unit: str) -> Iterator[Finding]:
    """What systemd-analyze says of the unit, offline."""
    if shutil.which("systemd-analyze") is None:
        yield Finding("unit", Verdict.DOUBTFUL, "not looked at: there is no systemd-analyze here")
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, UNIT_NAME)
        file.write_text(unit, encoding="utf-8")
        said, code = system.answer("systemd-analyze", "verify", str(file))
        # It exits with 0 where it complains of a line that it leaves out.
        is_clean = code == 0 and not said
        yield Finding(
            "unit",
            Verdict.GOOD if is_clean else Verdict.BAD,
            said.partition("\n")[0] or "in order",
            "" if is_clean else _AGAIN,
        )
        threshold = f"--threshold={MOST_EXPOSED * 10:.0f}"
        said, code = system.answer("systemd-analyze", "security", "--offline=true", "--no-pager", threshold, str(file))
        overall = said.rpartition("→ ")[2]
        yield Finding(
            "exposure",
            Verdict.GOOD if code == 0 else Verdict.BAD,
            overall.rpartition(": ")[2] or "unknown",
            "" if code == 0 else _AGAIN,
        )
