"""The battery: drained as PX4's battery simulator drains it, its voltage pulled down by what the motors draw.

Source: PX4's simulation/battery_simulator and lib/battery (voltage between BAT1_V_EMPTY and BAT1_V_CHARGED a cell).
PX4's simulator knows no current; here it follows from the thrust, so that voltage sags.
"""

from sim_vehicle.parameters.store import Parameters

# Ten times a second is how often PX4's own board support samples it.
PERIOD_US = 100_000
# A vehicle of the paper's size hovers at 200 to 250 W, 16 A from four cells: this much at full thrust, and momentum
# theory's power of 3/2 of the thrust below it.
FULL_THRUST_CURRENT_A = 26.0
# Electronics alone.
IDLE_CURRENT_A = 0.3
# PX4's own guess for a cell where BAT1_R_INTERNAL is not set.
CELL_RESISTANCE_OHM = 0.005


class Battery:
    """Charge and voltage; full again whenever the vehicle is disarmed, as in PX4's simulation."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.remaining = 1.0
        """Share of the charge that is left."""
        self.current_a = IDLE_CURRENT_A
        self.consumed_mah = 0.0
        self.voltage_v = 0.0
        self.version = 0
        """Grows with every new sample."""
        self.supply_share = 1.0
        """Voltage over what charge and current explain, where a fault has it sag."""
        self._sampled_us: int | None = None
        self._update_voltage()

    def update(self, now_us: int, armed: bool, thrust_fraction: float) -> None:
        """Call as often as you like; it takes a sample ten times a second."""
        if self._sampled_us is None:
            self._sampled_us = now_us
        elapsed_us = now_us - self._sampled_us
        if elapsed_us < PERIOD_US:
            return
        self._sampled_us = now_us
        thrust = max(thrust_fraction, 0.0) if armed else 0.0
        self.current_a = IDLE_CURRENT_A + FULL_THRUST_CURRENT_A * thrust**1.5
        self.consumed_mah += self.current_a * 1e3 * elapsed_us / 3.6e9
        self._drain(elapsed_us / 1e6, armed)
        self._update_voltage()
        self.version += 1

    def _drain(self, seconds: float, armed: bool) -> None:
        if not armed or not self._parameters["SIM_BAT_ENABLE"]:
            self.remaining = 1.0
            return
        least = self._parameters["SIM_BAT_MIN_PCT"] / 100
        self.remaining = max(self.remaining - seconds / self._parameters["SIM_BAT_DRAIN"], least)

    def _update_voltage(self) -> None:
        parameters = self._parameters
        empty, full = parameters["BAT1_V_EMPTY"], parameters["BAT1_V_CHARGED"]
        resistance = parameters["BAT1_R_INTERNAL"]
        sag = self.current_a * (resistance if resistance >= 0 else CELL_RESISTANCE_OHM)
        cell_v = empty + self.remaining * (full - empty) - sag
        self.voltage_v = self.supply_share * max(parameters["BAT1_N_CELLS"], 1) * cell_v
