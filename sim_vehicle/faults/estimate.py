"""Faults of the vehicle's estimate: it jumps, it resets after a clipped hit, it drifts without its sensors."""

import numpy as np

from sim_vehicle.faults.group import Group
from sim_vehicle.faults.spec import AidingLoss, EstimatorAfterClipping, EstimatorReset
from sim_vehicle.physics.layout import Disturbance, PlantState


class Estimate(Group[EstimatorReset | EstimatorAfterClipping | AidingLoss]):
    """How far the estimate is off (position m, velocity m/s, NED), and how often it has said that it jumped."""

    def __init__(self, drifts: bool, step_s: float, rng: np.random.Generator) -> None:
        """``drifts``: nothing else models what the loss of a sensor does."""
        super().__init__()
        self._drifts = drifts
        self._step_s = step_s
        self._rng = rng
        self._straying: list[AidingLoss] = []
        self._due_s: list[float] = []
        self._kick_m_s = 0.0
        self._settles_s = 1.0
        self._shift, self._velocity, self._drift = np.zeros(3), np.zeros(3), np.zeros(6)
        self.reset_counter = 0

    def act(self, time_s: float, state: PlantState, disturbance: Disturbance) -> None:
        self._velocity *= np.exp(-self._step_s / self._settles_s)
        self._jump(time_s)
        self._switch(time_s, state)
        self._stray(time_s)
        disturbance.estimate_jump[0:3] = self._shift + self._drift[0:3]
        disturbance.estimate_jump[3:6] = self._velocity + self._drift[3:6]

    def _jump(self, time_s: float) -> None:
        due = [fault for fault in self._faults if isinstance(fault, EstimatorReset) and fault.window_s[0] <= time_s]
        for reset in sorted(due, key=lambda reset: reset.window_s):
            # It happens once, and what has jumped stays.
            self.remove(reset)
            self._shift += reset.position_jump_ned_m
            self._velocity += reset.velocity_jump_ned_m_s
            self._settles_s = reset.settles_s
            self.reset_counter += 1

    def _switch(self, time_s: float, state: PlantState) -> None:
        """After a clipped hit resets follow, each leaving an error of its own."""
        hidden_m_s = float(np.linalg.norm(np.array(state.clipped_off_m_s)))
        for fault in self.acting(time_s):
            if not isinstance(fault, EstimatorAfterClipping) or hidden_m_s < fault.least_hidden_m_s:
                continue
            self._settles_s, self._kick_m_s = fault.settles_s, fault.kick_m_s
            if not self._due_s:
                self._due_s = [time_s + fault.over_s * (n + 1) / fault.resets for n in range(fault.resets)]
        while self._due_s and self._due_s[0] <= time_s:
            self._due_s.pop(0)
            self._velocity = self._kick_m_s * self._rng.standard_normal(3)
            self._shift += self._step_s * self._velocity
            self.reset_counter += 1

    def _stray(self, time_s: float) -> None:
        """Random walk of the velocity while a sensor is lost; when it is back the estimate jumps back to the truth."""
        if not self._drifts:
            return
        acting = [fault for fault in self.acting(time_s) if isinstance(fault, AidingLoss)]
        for fault in acting:
            # North and east: the barometer keeps the height.
            walk = fault.drift_m_s2 * np.sqrt(self._step_s) * self._rng.standard_normal(3)
            self._drift[3:5] += walk[:2]
            self._drift[0:2] += self._step_s * self._drift[3:5]
        over = [fault for fault in self._straying if not any(fault is still for still in acting)]
        if over:
            self._drift[:] = 0.0
            self.reset_counter += len(over)
        self._straying = acting
