"""The simulated vehicle in real time, or faster by a factor, on any number of ports."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from sim_vehicle.shell.ports import Port
from sim_vehicle.shell.truth_file import save_truth
from sim_vehicle.vehicle import SimulatedVehicle

# Lateness up to this is caught up by stepping faster, as a busy machine needs. A longer stop (a
# suspended laptop) would end in a burst of old telemetry: there the vehicle's clock stands still instead.
MOST_CAUGHT_UP_NS = 500_000_000


def serve(
    vehicle: SimulatedVehicle,
    ports: Sequence[Port],
    truth_path: Path | None = None,
    stop: Callable[[], bool] = lambda: False,
    speed: float = 1.0,
) -> None:
    """Fly until ``stop()`` is true; then close the ports and write the truth, if a path is given.

    ``speed``: how many times faster than the clock, at most; 0 for as fast as the machine allows.
    """
    pace = RealtimePace(vehicle.time_boot_us, speed)
    try:
        while not stop():
            serve_interval(vehicle, ports, pace, vehicle.advance)
    finally:
        for port in ports:
            port.close()
        if truth_path is not None:
            save_truth(truth_path, vehicle.truth, pace.epoch_at_boot_us(), pace.stalls)


def serve_interval(
    vehicle: SimulatedVehicle, ports: Sequence[Port], pace: "RealtimePace", advance: Callable[[], None]
) -> None:
    """Wait until the next interval may begin, then fly it between what has arrived and what is sent."""
    pace.wait_until(vehicle.time_boot_us + vehicle.interval_us)
    for port in ports:
        port.receive()
    advance()
    for port in ports:
        port.send()


class RealtimePace:
    """Keeps a vehicle's clock on the machine's monotonic one."""

    def __init__(
        self,
        time_boot_us: int,
        speed: float = 1.0,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        sleep_s: Callable[[float], None] = time.sleep,
    ) -> None:
        self._monotonic_ns = monotonic_ns
        self._sleep_s = sleep_s
        self._time_boot_us = time_boot_us
        self.stalls: list[tuple[int, int]] = []
        """Boot times at which the vehicle's clock stood while the machine's went on, and for how long, microseconds."""
        self._boot_ns: int | None = None
        self.restart(speed)

    def restart(self, speed: float) -> None:
        """Go on from now at a speed (1: real time), after another speed or a pause."""
        self.speed = speed
        self._ns_per_us = 1000 / speed if speed > 0 else 0.0
        self._begin(self._monotonic_ns() - round(self._ns_per_us * self._time_boot_us))

    def _begin(self, boot_ns: int) -> None:
        """When the vehicle's clock would have read 0, from now on."""
        if self._boot_ns is not None:
            at_us, late_us = self._time_boot_us, (boot_ns - self._boot_ns) // 1000
            if self.stalls and self.stalls[-1][0] == at_us:
                late_us += self.stalls.pop()[1]
            self.stalls.append((at_us, late_us))
        self._boot_ns = boot_ns

    def wait_until(self, time_boot_us: int) -> None:
        """Return when the vehicle's clock may show that; at once when it is late."""
        if (early_s := self.early_s(time_boot_us)) > 0.0:
            self._sleep_s(early_s)

    def early_s(self, time_boot_us: int) -> float:
        """How long it is until the vehicle's clock may show that; 0 when it is late."""
        self._time_boot_us = time_boot_us
        if self._ns_per_us == 0.0:
            return 0.0
        now_ns = self._monotonic_ns()
        assert self._boot_ns is not None, "restart begins it"
        late_ns = now_ns - self._boot_ns - round(self._ns_per_us * time_boot_us)
        if late_ns > MOST_CAUGHT_UP_NS:
            self._begin(self._boot_ns + late_ns)
        return 1e-9 * max(-late_ns, 0)

    def epoch_at_boot_us(self) -> int:
        """Wall clock at the vehicle's boot time 0, as its clock stands now."""
        if self._ns_per_us != 1000.0:
            return time.time_ns() // 1000 - self._time_boot_us
        assert self._boot_ns is not None, "restart begins it"
        return (time.time_ns() - self._monotonic_ns() + self._boot_ns) // 1000
