"""What the companion knew, put into the log that PX4 itself wrote of the same flight.

Both have one clock: the stamp of an IMU sample on the link is the one that PX4 logs it under. That they are of one
flight is shown by the angular rates, and nothing is moved.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from companion.shell.files import write_whole
from rebound_cli.export.ulog import own_rows, with_rows
from rebound_cli.logs.log import Log, LogError
from rebound_cli.logs.ulog import read_ulog
from rebound_cli.report.shown_flight import ShownFlight

Floats = npt.NDArray[np.float64]

# The rates are compared with the log's, moved by up to so much to both sides: longer than any link delays a sample.
_MOST_LAG_US = 1_000_000
# Of so many samples two unlike logs share 1 % at the most by chance: the correlation's spread is 1 / sqrt(n).
_SAMPLES = 10_000
# Between what one flight has and two: of five real flights of PX4 each pair shared less than 1 %, at any lag.
_LEAST_SHARED = 0.5


@dataclass(frozen=True, slots=True)
class Fit:
    """How well a record and a log go together: samples in the log's time, how much of the variance of their rates the
    log explains, and by how much the log would have to be moved to explain the most of it.
    """

    samples: int
    of: int
    shared: float
    lag_us: int

    def text(self) -> str:
        return (
            f"{self.samples} of {self.of} IMU samples lie in its time, it explains {100.0 * self.shared:.1f} % "
            f"of their angular rates, and fits best moved by {self.lag_us / 1e3:+.1f} ms"
        )


def merge(flight: ShownFlight, log: Log, ulog: Path, out: Path) -> Fit:
    """PX4's log with the companion's events, hits and setpoints, into a new file. Raises LogError, OSError."""
    fit = fitted(log, read_ulog(ulog))
    try:
        content = with_rows(ulog.read_bytes(), list(own_rows(flight, log)))
    except LogError as error:
        raise LogError(f"{ulog}: {error}.") from error
    write_whole(out, content)
    return fit


def fitted(ours: Log, theirs: Log) -> Fit:
    """Raises LogError where the two are not of one flight."""
    our_us, our_rates = _rates(ours)
    their_us, their_rates = _rates(theirs)
    interval_us = int(max(np.median(np.diff(our_us)), np.median(np.diff(their_us))))
    inside = (our_us >= their_us[0] + _MOST_LAG_US) & (our_us <= their_us[-1] - _MOST_LAG_US)
    samples, every = int(inside.sum()), max(1, len(our_us) // _SAMPLES)
    wrong = f"{theirs.path} and {ours.path} are not of one flight"
    if samples * interval_us < _MOST_LAG_US:
        spans = (
            f"{their_us[0] / 1e6:.1f} to {their_us[-1] / 1e6:.1f} s",
            f"{our_us[0] / 1e6:.1f} to {our_us[-1] / 1e6:.1f} s",
        )
        raise LogError(f"{wrong}: by PX4's clock since boot the one is of {spans[0]}, the other of {spans[1]}.")
    our_us, our_rates = our_us[inside][::every], our_rates[inside][::every]
    steps = _MOST_LAG_US // interval_us
    lags_us = interval_us * np.arange(-steps, steps + 1)
    shares = [_shared(our_rates, _at(our_us - lag_us, their_us, their_rates)) for lag_us in lags_us]
    best = int(np.argmax(shares))
    fit = Fit(samples, len(inside), shares[best], int(lags_us[best]))
    if fit.shared < _LEAST_SHARED or abs(fit.lag_us) > interval_us:
        raise LogError(f"{wrong}: {fit.text()}.")
    return fit


def _rates(log: Log) -> tuple[Floats, Floats]:
    """Stamps and angular rates, in the order of the stamps."""
    samples = [sample for _, sample in log.imu()]
    times_us = np.array([sample.time_boot_us for sample in samples], np.float64)
    order = np.argsort(times_us, kind="stable")
    return times_us[order], np.array([sample.angular_velocity_frd_rad_s for sample in samples])[order]


def _at(wanted_us: Floats, times_us: Floats, rates: Floats) -> Floats:
    return np.column_stack([np.interp(wanted_us, times_us, axis) for axis in rates.T])


def _shared(one: Floats, other: Floats) -> float:
    """The share of variance that they have in common, all axes together; what a gyroscope's bias adds is left out."""
    a, b = one - one.mean(axis=0), other - other.mean(axis=0)
    both = float((a * a).sum() * (b * b).sum())
    together = max(0.0, float((a * b).sum()))
    return together**2 / both if both > 0.0 else 0.0
