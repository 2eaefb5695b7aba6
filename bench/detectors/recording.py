"""A stretch of simulated flight as its intervals went by: what the vehicle's software knew, and the truth beside it."""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from companion.reflex.detector import Situation
from sim_vehicle.autopilot.autopilot import POSITION_PERIOD_US
from sim_vehicle.physics.layout import HIT_IMPULSE, HIT_START_US
from sim_vehicle.plant.plant import Plant, PlantOutput

Floats = npt.NDArray[np.float64]
Vector3 = tuple[float, float, float]


@dataclass(slots=True)
class VehicleRecording:
    """One entry an interval in each list. `published` is the state estimate as of 8 ms, as PX4 publishes it."""

    samples: list[PlantOutput] = field(default_factory=list)
    published: list[PlantOutput] = field(default_factory=list)
    asked_attitudes: list[list[list[float]]] = field(default_factory=list)
    """Rotation matrices that the position control asked for."""
    situations: list[Situation] = field(default_factory=list)
    contact_m_s2: list[float] = field(default_factory=list)
    """The obstacles' mean force on the vehicle over the interval, per unit mass. The ground's is not in it."""
    _state: tuple[Floats, Floats] | None = None
    """Views of the plant's state, taken once: looking a field up costs microseconds."""
    _impulse: tuple[float, Vector3] = (0.0, (0.0, 0.0, 0.0))

    def add(self, plant: Plant, sample: PlantOutput, situation: Situation, mass_kg: float) -> None:
        """Take an interval that the plant has just advanced by."""
        latest = self.published[-1] if self.published else sample
        is_due = sample.time_boot_us - latest.time_boot_us >= POSITION_PERIOD_US
        self.samples.append(sample)
        self.published.append(sample if is_due else latest)
        if self._state is None:
            self._state = plant.state.hit, plant.state.attitude_setpoint
        self.asked_attitudes.append(self._state[1].tolist())
        self.situations.append(situation)
        self.contact_m_s2.append(self._contact_n_s(self._state[0]) / (mass_kg * 1e-6 * plant.interval_us))

    def _contact_n_s(self, hit: Floats) -> float:
        """Size of the impulse that the obstacles gave in the latest interval."""
        started_us = float(hit[HIT_START_US])
        if started_us == 0.0:
            return 0.0
        x, y, z = hit[HIT_IMPULSE].tolist()
        before = self._impulse[1] if started_us == self._impulse[0] else (0.0, 0.0, 0.0)
        self._impulse = (started_us, (x, y, z))
        return math.dist((x, y, z), before)
