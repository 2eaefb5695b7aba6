"""How this computer is: Linux's own files, read once a second for the ground station."""

import shutil
from contextlib import suppress
from pathlib import Path

from companion.messages import ComputerStatus

_MIB = 1 << 20
_KIB_A_MIB = 1024
# Fields of a line of /proc/stat (proc(5)): of these the core did nothing.
_IDLE, _IOWAIT = 3, 4
# Guest time is in user time already.
_COUNTED = 8


class ComputerReader:
    """Of the disk that `folder` is on. `system` is where proc and sys are."""

    def __init__(self, folder: Path, system: Path = Path("/")) -> None:
        self._folder, self._system = folder, system
        self._ticks: list[tuple[int, int]] = []  # of each core by the last reading: busy, all

    def read(self, now_us: int) -> ComputerStatus:
        """Raises OSError, ValueError, KeyError where there is no Linux."""
        memory = self._memory_mib()
        disk = shutil.disk_usage(self._folder)
        uptime_s = float((self._system / "proc/uptime").read_text().split()[0])
        return ComputerStatus(
            at_us=now_us,
            uptime_ms=round(uptime_s * 1e3),
            cpu_percent=self._cpu_percent(),
            temperature_deg_c=self._temperature_deg_c(),
            memory_used_mib=memory["MemTotal"] - memory["MemAvailable"],
            memory_total_mib=memory["MemTotal"],
            disk_used_mib=(disk.total - disk.free) // _MIB,
            disk_total_mib=disk.total // _MIB,
        )

    def _cpu_percent(self) -> tuple[int, ...]:
        """Of each core since the last reading; the first is since the computer was started."""
        lines = (self._system / "proc/stat").read_text().splitlines()
        cores = [list(map(int, line.split()[1:][:_COUNTED])) for line in lines if line[:3] == "cpu" and line[3] != " "]
        ticks = [(sum(core) - core[_IDLE] - core[_IOWAIT], sum(core)) for core in cores]
        before = self._ticks if len(self._ticks) == len(ticks) else [(0, 0)] * len(ticks)
        self._ticks = ticks
        spent = [(busy - was_busy, total - was) for (busy, total), (was_busy, was) in zip(ticks, before, strict=True)]
        # The kernel may take idle time back by a tick.
        return tuple(min(max(round(100 * busy / total), 0), 100) if total > 0 else 0 for busy, total in spent)

    def _memory_mib(self) -> dict[str, int]:
        lines = (self._system / "proc/meminfo").read_text().splitlines()
        return {name: int(rest.split()[0]) // _KIB_A_MIB for name, _, rest in (line.partition(":") for line in lines)}

    def _temperature_deg_c(self) -> int | None:
        """The hottest zone; a machine may have none."""
        found: list[int] = []
        for zone in (self._system / "sys/class/thermal").glob("thermal_zone*/temp"):
            # A sensor that is switched off answers with an error.
            with suppress(OSError, ValueError):
                found.append(round(int(zone.read_text()) / 1e3))
        return max(found, default=None)
