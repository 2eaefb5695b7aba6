"""A vehicle under test on virtual time: bytes in, bytes out, the same bits every time, as fast as the machine goes."""

from typing import Any

from sim_vehicle.bench.bench import Bench, Condition, Setup
from sim_vehicle.errors import ConditionNotMet
from sim_vehicle.mavlink.streams.stream_rates import link_kind


class LockstepVehicle(Bench):
    """Nothing happens but in `advance`: no socket, no thread, no clock."""

    def __init__(self, streams: str = "onboard", **setup: Any) -> None:
        """``setup``: the fields of `Setup`. ``streams``: onboard, normal or ground, PX4's sets for a link.

        Raises AirframeError, SceneError, ParameterError and LinkAddressError.
        """
        super().__init__(Setup(**setup))
        self._link = self.vehicle.add_link(link_kind(streams))

    def send(self, data: bytes) -> None:
        """MAVLink bytes to the vehicle, which reads them in the next interval."""
        self._link.push(data)

    def advance(self, seconds: float) -> bytes:
        """Advance time in whole intervals (4 ms unless IMU_INTEG_RATE is changed), at least one; return what the
        vehicle has sent.
        """
        until_us = self.vehicle.time_boot_us + round(1e6 * seconds)
        sent = self._step()
        while self.vehicle.time_boot_us < until_us:
            sent += self._step()
        return b"".join(sent)

    def advance_until(self, condition: Condition, within_s: float) -> bytes:
        """Let time pass until a condition on the truth holds; return what the vehicle has sent.

        Raises ConditionNotMet when it does not within that time.
        """
        until_us = self.vehicle.time_boot_us + round(1e6 * within_s)
        sent: list[bytes] = []
        while not condition(self.truth):
            if self.vehicle.time_boot_us >= until_us:
                raise ConditionNotMet(f"the condition did not hold within {within_s:g} s (seed {self.setup.seed}).")
            sent += self._step()
        return b"".join(sent)

    def _step(self) -> list[bytes]:
        self.step()
        return list(self._link.take())
