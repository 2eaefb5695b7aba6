"""Any log by its path."""

from pathlib import Path

from rebound_cli.logs.log import Log, LogError

_ULOG_MAGIC = b"ULog"


def read_log(path: Path) -> Log:
    """A .ulg by its first bytes, whatever its name; everything else as a telemetry log. Raises LogError, OSError."""
    from rebound_cli.logs.telemetry import read_telemetry
    from rebound_cli.logs.ulog import read_ulog

    with path.open("rb") as file:
        magic = file.read(len(_ULOG_MAGIC))
    if not magic:
        raise LogError(f"{path}: the file is empty.")
    log = read_ulog(path) if magic == _ULOG_MAGIC or path.suffix == ".ulg" else read_telemetry(path)
    if len(log.imu()) < 2:
        raise LogError(f"{path}: no IMU samples in it; a collision cannot be looked for without them.")
    return log
