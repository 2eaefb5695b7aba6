"""The battery: drained as PX4's battery simulator drains it, which knows no current.

Source: PX4's simulation/battery_simulator and lib/battery (voltage between BAT1_V_EMPTY and BAT1_V_CHARGED a cell).
"""

from sim_vehicle.parameters.store import Parameters

# Ten times a second is how often PX4's own board support samples it.
PERIOD_US = 100_000


class Battery:
    """Charge and voltage; full again whenever the vehicle is disarmed, as in PX4's simulation."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.remaining = 1.0
        """Share of the charge that is left."""
        self.version = 0
        """Grows with every new sample."""
        self.supply_share = 1.0
        """Voltage over what the charge explains, where a fault has it sag."""
        self._sampled_us: int | None = None

    def update(self, now_us: int, armed: bool) -> None:
        """Call as often as you like; it takes a sample ten times a second."""
        if self._sampled_us is None:
            self._sampled_us = now_us
        elapsed_us = now_us - self._sampled_us
        if elapsed_us < PERIOD_US:
            return
        self._sampled_us = now_us
        self._drain(elapsed_us / 1e6, armed)
        self.version += 1

    def _drain(self, seconds: float, armed: bool) -> None:
        if not armed or not self._parameters["SIM_BAT_ENABLE"]:
            self.remaining = 1.0
            return
        least = self._parameters["SIM_BAT_MIN_PCT"] / 100
        self.remaining = max(self.remaining - seconds / self._parameters["SIM_BAT_DRAIN"], least)

    @property
    def voltage_v(self) -> float:
        """Of all cells together."""
        empty, full = self._parameters["BAT1_V_EMPTY"], self._parameters["BAT1_V_CHARGED"]
        cell_v = empty + self.remaining * (full - empty)
        return self.supply_share * max(self._parameters["BAT1_N_CELLS"], 1) * cell_v
