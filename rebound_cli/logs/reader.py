"""Any log by its path."""

from pathlib import Path

from rebound_cli.logs.log import Log, LogError

_ULOG_MAGIC = b"ULog"


def read_log(path: Path) -> Log:
    """A .ulg by its first bytes, whatever its name; everything else as a telemetry log. Raises LogError."""
    from rebound_cli.logs.telemetry import read_telemetry
    from rebound_cli.logs.ulog import read_ulog

    try:
        with path.open("rb") as file:
            magic = file.read(len(_ULOG_MAGIC))
    except FileNotFoundError:
        raise LogError(f"{path}: no such file.") from None
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror or error}.") from error
    if not magic:
        raise LogError(f"{path}: the file is empty.")
    if magic == _ULOG_MAGIC or path.suffix == ".ulg":
        return read_ulog(path)
    return read_telemetry(path)
