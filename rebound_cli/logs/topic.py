"""The columns of one kind of message in a log, in the order of time."""

from collections.abc import Iterator, Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from companion.messages import POSITION_M

Floats = npt.NDArray[np.float64]


class Topic:
    """One instance of a topic. Fields that this version has not are None."""

    def __init__(self, data: Mapping[str, npt.NDArray[Any]]) -> None:
        with np.errstate(invalid="ignore"):  # damage can make a stamp of any size
            stamps = data["timestamp"].astype(np.int64)
        order = np.argsort(stamps, kind="stable")
        self.time_us: npt.NDArray[np.int64] = stamps[order]
        self._fields = {name: values[order] for name, values in data.items()}

    def __len__(self) -> int:
        return len(self.time_us)

    def column(self, *names: str) -> Floats | None:
        """The first of these fields that there is."""
        values = next((self._fields[name] for name in names if name in self._fields), None)
        with np.errstate(invalid="ignore"):  # damage can make a signalling NaN
            return None if values is None else values.astype(np.float64)

    def vector(self, *names: str) -> Floats | None:
        """Fields side by side, one row a sample; None when one of them is missing."""
        columns = [column for name in names if (column := self.column(name)) is not None]
        return np.column_stack(columns) if len(columns) == len(names) else None

    def array(self, name: str, length: int = 3) -> Floats | None:
        return self.vector(*(f"{name}[{index}]" for index in range(length)))

    def rows(self, values: Floats | None) -> Iterator[tuple[int, int, list[float]]]:
        """Number, time and values of each sample that is whole: a damaged one has values of any size, or none."""
        if values is not None:
            for index in np.flatnonzero((np.abs(values) <= POSITION_M).all(axis=1)).tolist():
                yield index, int(self.time_us[index]), values[index].tolist()

    def rate_hz(self) -> float:
        """Samples a second; gaps count for nothing."""
        intervals_us = np.diff(np.unique(self.time_us))
        return 1e6 / float(np.median(intervals_us)) if len(intervals_us) else 0.0

    def held(self, values: Floats, at_us: npt.NDArray[np.int64]) -> tuple[Floats, npt.NDArray[np.bool_]]:
        """The last value at each time, the first before that; and where there was one yet."""
        index = np.searchsorted(self.time_us, at_us, side="right") - 1
        return values[np.maximum(index, 0)], index >= 0

    def only(self, chosen: npt.NDArray[np.bool_]) -> Self:
        """The chosen ones of the samples."""
        return type(self)({"timestamp": self.time_us[chosen]} | {k: v[chosen] for k, v in self._fields.items()})
