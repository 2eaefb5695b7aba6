"""How this computer is, read once a second for the ground station."""

import time
from pathlib import Path

import psutil

from companion.messages import ComputerStatus

_MIB = 1 << 20


def computer_status(folder: Path, now_us: int) -> ComputerStatus:
    """With the disk that `folder` is on. The load of each core is that since the last call; at first it is 0."""
    memory, disk, zones = psutil.virtual_memory(), psutil.disk_usage(str(folder)), psutil.sensors_temperatures()
    # The hottest zone; a machine may have none.
    hottest_deg_c = max((zone.current for sensor in zones.values() for zone in sensor), default=None)
    return ComputerStatus(
        at_us=now_us,
        uptime_ms=round(1e3 * time.clock_gettime(time.CLOCK_BOOTTIME)),
        cpu_percent=tuple(map(round, psutil.cpu_percent(percpu=True))),
        temperature_deg_c=None if hottest_deg_c is None else round(hottest_deg_c),
        memory_used_mib=(memory.total - memory.available) // _MIB,
        memory_total_mib=memory.total // _MIB,
        disk_used_mib=(disk.total - disk.free) // _MIB,
        disk_total_mib=disk.total // _MIB,
    )
