"""A .ulg file as arrays by topic; pyulog reads it, damage and truncation included."""

import contextlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pyulog import ULog

from rebound_cli.logs.log import LogError

Floats = npt.NDArray[np.float64]

# Every ULog message begins with its size and its type.
_HEADER_SIZE = 3
# vehicle_status.arming_state, the same number since 2015.
ARMED = 2


@dataclass(frozen=True, slots=True)
class Topic:
    """One instance of a uORB topic, in the order of time. Fields that this version has not are None."""

    time_us: npt.NDArray[np.int64]
    fields: Mapping[str, npt.NDArray[Any]]

    def column(self, name: str) -> Floats | None:
        values = self.fields.get(name)
        with np.errstate(invalid="ignore"):  # damage can make a signalling NaN
            return None if values is None else values.astype(np.float64)

    def vector(self, *names: str) -> Floats | None:
        """Fields side by side, one row a sample; None when one of them is missing."""
        columns = [self.column(name) for name in names]
        present = [column for column in columns if column is not None]
        return np.column_stack(present) if len(present) == len(names) else None

    def array(self, name: str, length: int = 3) -> Floats | None:
        return self.vector(*(f"{name}[{index}]" for index in range(length)))

    def rate_hz(self) -> float:
        lasted_us = int(self.time_us[-1] - self.time_us[0])
        return (len(self.time_us) - 1) * 1e6 / lasted_us if lasted_us > 0 else 0.0


class Topics:
    """All topics that were asked for, and what the file says about itself. Raises LogError."""

    def __init__(self, path: Path, names: Sequence[str]) -> None:
        log = _read(path, names)
        self._topics = {
            (data.name, data.multi_id): _topic(data.data)
            for data in log.data_list
            if len(data.data.get("timestamp", ()))
        }
        self.is_damaged = bool(log.file_corruption)
        self.lost_s = sum(dropout.duration for dropout in log.dropouts) * 1e-3
        self.parameters = {
            name: float(value) for name, value in log.initial_parameters.items() if isinstance(value, int | float)
        }
        self.hardware = str(log.msg_info_dict.get("ver_hw", ""))
        release = log.msg_info_dict.get("ver_sw_release")
        self.version = None
        if isinstance(release, int):
            self.version = (release >> 24 & 0xFF, release >> 16 & 0xFF, release >> 8 & 0xFF)
        # Instants that topics share; a log's own start may lie hours of waiting before its data.
        self.started_us = int(log.start_timestamp)

    def get(self, name: str, instance: int = 0) -> Topic | None:
        return self._topics.get((name, instance))

    def instances(self, name: str) -> list[Topic]:
        return [topic for (found, _), topic in sorted(self._topics.items()) if found == name]

    def first(self, *names: str) -> Topic | None:
        """The first of these topics that the log has."""
        return next((topic for name in names if (topic := self.get(name)) is not None), None)


class _Content(io.BytesIO):
    """A file in memory. Where its end cuts a message of the head, pyulog would go back and read it again for ever."""

    _message_at = 0

    def read(self, size: int | None = -1, /) -> bytes:
        if size == _HEADER_SIZE:
            self._message_at = self.tell()
        return super().read(size)

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        if whence == io.SEEK_CUR and self.tell() + offset < self._message_at:
            raise EOFError("it is cut short")
        return super().seek(offset, whence)


def _read(path: Path, names: Sequence[str]) -> ULog:
    try:
        # It prints its warnings; what they say is asked for below.
        with contextlib.redirect_stdout(io.StringIO()):
            return ULog(_Content(path.read_bytes()), list(names))
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror or error}.") from error
    except Exception as error:  # damaged files make it raise whatever the bytes led to
        raise LogError(f"{path}: not a readable PX4 log: {error or type(error).__name__}.") from error


def _topic(data: Mapping[str, npt.NDArray[Any]]) -> Topic:
    time_us = data["timestamp"].astype(np.int64)
    order = np.argsort(time_us, kind="stable")
    return Topic(time_us[order], {name: values[order] for name, values in data.items()})
