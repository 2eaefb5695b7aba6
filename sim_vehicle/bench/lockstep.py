"""A vehicle under test on virtual time: bytes in, bytes out, the same bits every time, as fast as the machine goes."""

from typing import Any

from sim_vehicle.bench.bench import Bench, Condition, Handle, ObstacleSpec, Setup
from sim_vehicle.bench.faults import FaultRequest
from sim_vehicle.bench.timeline import TimelineEntry
from sim_vehicle.bench.truth import Truth
from sim_vehicle.errors import ConditionNotMet
from sim_vehicle.mavlink.link import LinkOptions
from sim_vehicle.mavlink.streams.stream_rates import link_kind
from sim_vehicle.truth import TruthRecorder


class LockstepVehicle:
    """Nothing happens but in `advance`: no socket, no thread, no clock."""

    def __init__(self, streams: str = "onboard", **setup: Any) -> None:
        """``setup``: the fields of `Setup`. ``streams``: onboard, normal or ground, PX4's sets for a link.

        Raises AirframeError, SceneError, ParameterError and LinkAddressError.
        """
        self._bench = Bench(Setup(**setup))
        self._link = self._bench.vehicle.add_link(LinkOptions(link_kind(streams)))

    @property
    def setup(self) -> Setup:
        """With what it began."""
        return self._bench.setup

    @property
    def time_s(self) -> float:
        """The vehicle's clock, seconds since boot."""
        return self._bench.vehicle.time_boot_us / 1e6

    @property
    def truth(self) -> Truth:
        """What is really so at this moment."""
        return self._bench.truth

    @property
    def recorded(self) -> TruthRecorder:
        """The whole flight: its path as arrays, all hits, all faults."""
        return self._bench.vehicle.truth

    @property
    def timeline(self) -> tuple[TimelineEntry, ...]:
        """What has happened so far."""
        return self._bench.timeline.events

    def send(self, data: bytes) -> None:
        """MAVLink bytes to the vehicle, which reads them in the next interval."""
        self._link.push(data)

    def advance(self, seconds: float) -> bytes:
        """Advance time in whole intervals (4 ms unless IMU_INTEG_RATE is changed), at least one; return what the
        vehicle has sent.
        """
        until_us = self._bench.vehicle.time_boot_us + round(1e6 * seconds)
        sent = self._step()
        while self._bench.vehicle.time_boot_us < until_us:
            sent += self._step()
        return b"".join(sent)

    def advance_until(self, condition: Condition, within_s: float) -> bytes:
        """Let time pass until a condition on the truth holds; return what the vehicle has sent.

        Raises ConditionNotMet when it does not within that time.
        """
        until_us = self._bench.vehicle.time_boot_us + round(1e6 * within_s)
        sent: list[bytes] = []
        while not condition(self._bench.truth):
            if self._bench.vehicle.time_boot_us >= until_us:
                raise ConditionNotMet(f"the condition did not hold within {within_s:g} s (seed {self.setup.seed}).")
            sent += self._step()
        return b"".join(sent)

    def place(self, *obstacles: ObstacleSpec) -> Handle:
        """Put obstacles into the world; the times of a motion count from now.

        Raises SceneError for one that would be in the vehicle.
        """
        return self._bench.place(*obstacles)

    def hit(self, speed_m_s: float, bearing_deg: float = 0.0, elevation_deg: float = 0.0) -> str:
        """Swing a plate at the vehicle: it touches at that speed 20 ms from now, coming from there,
        clockwise from the nose (90 is the right) or from above (elevation 90). Returns the name the hit will have."""
        return self._bench.hit(speed_m_s, bearing_deg, elevation_deg)

    def inject(self, fault: FaultRequest, for_s: float | None = None, after_s: float = 0.0) -> Handle:
        """Let something of `sim_vehicle.testing.faults` go wrong now, for a while or until it is removed."""
        return self._bench.inject(fault, for_s, after_s)

    def _step(self) -> list[bytes]:
        self._bench.advance()
        return list(self._link.take())
