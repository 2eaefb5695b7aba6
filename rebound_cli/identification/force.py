"""The hit as the force sensor in the wall showed it, on the sensor's own clock."""

import numpy as np

from rebound_cli.identification.hit import Force
from rebound_cli.identification.table import Table

# The ringing after a hit is part of the impulse; half a second holds that of a mounting down to 10 Hz.
_RINGING_S = 0.5
_BEFORE_S = 0.1
# A hit stands out of the sensor's noise by at least this.
_LEAST_PEAK_SIGMAS = 10.0


def force_of(table: Table) -> Force | None:
    """The largest force in the file less its resting value; None without a sensor or a push."""
    if len(table.force_time_s) < 2:
        return None
    force = table.force_n - np.median(table.force_n, axis=0)
    size = np.sqrt((force**2).sum(axis=1))
    at = int(np.argmax(size))
    if size[at] < _LEAST_PEAK_SIGMAS * float(np.median(size)):
        return None
    along = force @ (force[at] / size[at])
    time_s = table.force_time_s - table.force_time_s[at]
    near = (time_s > -_BEFORE_S) & (time_s < _RINGING_S)
    return Force(
        peak_n=float(along[near].max()),
        pull_n=float(max(0.0, -along[near].min())),
        impulse_n_s=float(np.trapezoid(along[near], time_s[near])),
    )
