"""What the streams send: the state of the vehicle as its messages show it."""

from dataclasses import dataclass, field

import numpy as np

from sim_vehicle.autopilot.autopilot import Autopilot
from sim_vehicle.estimator.estimate import Estimate
from sim_vehicle.estimator.samples import FlowSample, RangeSample
from sim_vehicle.hil.slow_sensors import SlowSensors
from sim_vehicle.quantities import Floats


@dataclass(slots=True)
class Telemetry:
    """What the streams send: the newest sample, the last published position, and who flies."""

    sample: Estimate
    published: Estimate
    autopilot: Autopilot
    slow: SlowSensors
    position_variance_m2: float
    velocity_variance_m2_s2: float
    attitude_variance_rad2: float
    flow: FlowSample | None = None
    range: RangeSample | None = None
    attitude_setpoint: Floats = field(default_factory=lambda: np.eye(3))
    """The attitude control's R_d (3, 3), body to NED."""
    renewed: tuple[bool, ...] = (False, False)
    """For the message that is being made: see `StreamKind.notes`."""
    epoch_at_boot_us: int = 0
    """Unix time at the vehicle's boot."""
    system: int = 1
    """MAV_SYS_ID."""
