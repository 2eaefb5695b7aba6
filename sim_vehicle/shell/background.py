"""A vehicle under test on real sockets, flown by a thread of its own, which always ends."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self, TypeVar

from sim_vehicle.bench.bench import Bench, Condition, Handle, ObstacleSpec, Setup
from sim_vehicle.bench.faults import FaultRequest
from sim_vehicle.bench.truth import TimelineEntry, Truth
from sim_vehicle.errors import ConditionNotMet, SimulationError, VehicleEnded
from sim_vehicle.mavlink.streams.stream_rates import link_kind
from sim_vehicle.parameters.store import time_outs_at
from sim_vehicle.shell.addresses import open_port
from sim_vehicle.shell.ports import Port, TcpServerPort, UdpServerPort
from sim_vehicle.shell.realtime import RealtimePace, serve_interval
from sim_vehicle.shell.truth_file import save_truth
from sim_vehicle.truth import TruthRecorder

Answer = TypeVar("Answer")

_HERE = "127.0.0.1"
# Slower than this an order would wait for seconds until the next interval.
_SLOWEST = 0.01


def start_vehicle(
    speed: float = 1.0, streams: str = "onboard", links: tuple[str, ...] = (), **setup: Any
) -> "RunningVehicle":
    """A vehicle on free ports of this machine, in the air of nobody else; it ends with `stop()` or its `with` block.

    ``speed``: how many times real time, at most; 0 for as fast as it goes. At another than these two the time-outs
    that wait for clients are stretched with it, as PX4's simulators do. ``streams``: onboard, normal or ground,
    PX4's sets for a link. ``links``: more addresses, as `rebound sim --link` takes. ``setup``: the fields of `Setup`.
    Raises AirframeError, SceneError, ParameterError, LinkAddressError and PortInUse.
    """
    _check(speed)
    parameters = {**time_outs_at(speed), **setup.pop("parameters", {})}
    bench = Bench(Setup(parameters=parameters, **setup), time.time_ns() // 1000)
    kind = link_kind(streams)
    with ExitStack() as opened:
        # What has been opened before one that cannot be had is closed again.
        udp = opened.enter_context(closing(UdpServerPort(bench.vehicle, kind, _HERE, 0)))
        tcp = opened.enter_context(closing(TcpServerPort(bench.vehicle, kind, _HERE, 0)))
        others = [opened.enter_context(closing(open_port(bench.vehicle, address))) for address in links]
        opened.pop_all()
    return RunningVehicle(bench, [udp, tcp, *others], udp.local_port, tcp.local_port, speed)


def _check(speed: float) -> None:
    if speed != 0.0 and not _SLOWEST <= speed <= 1000.0:
        raise SimulationError(f"a speed is 0 or from {_SLOWEST:g} to 1000, and not {speed:g}.")


@dataclass(frozen=True, slots=True)
class _Waiting:
    """Somebody who waits for a condition."""

    condition: Condition
    until_us: int
    refusal: Exception
    future: "Future[Truth]"

    def is_over(self, truth: Truth, now_us: int) -> bool:
        """Look; whether the waiting is over, one way or another."""
        try:
            if self.condition(truth):
                self.future.set_result(truth)
            elif now_us >= self.until_us:
                self.future.set_exception(self.refusal)
        except Exception as problem:
            self.future.set_exception(problem)
        return self.future.done()


class RunningVehicle:
    """What `start_vehicle` gives. Every method may be called from any thread; all wait for the interval's end."""

    def __init__(self, bench: Bench, ports: list[Port], udp_port: int, tcp_port: int, speed: float) -> None:
        self.address = f"udpout://{_HERE}:{udp_port}"
        """For MAVSDK."""
        self.tcp_address = f"tcpout://{_HERE}:{tcp_port}"
        """For MAVSDK over TCP."""
        self.mavutil_address = f"tcp:{_HERE}:{tcp_port}"
        """For pymavlink's `mavutil.mavlink_connection` and MAVProxy."""
        self.udp_port, self.tcp_port = udp_port, tcp_port
        self._bench, self._ports = bench, ports
        self._pace = RealtimePace(bench.vehicle.time_boot_us, speed)
        self._waiting: list[_Waiting] = []
        self._is_paused = self._has_ended = False
        self._problem: Exception | None = None
        self._reported = False
        self._ident: int | None = None
        # One thread flies an interval after the other, and does in between what is asked of it.
        self._thread = ThreadPoolExecutor(1, "simulated vehicle", self._begin)
        self._flies = True
        self._thread.submit(self._fly)

    # --- what a test does --------------------------------------------------------------------------------

    def place(self, *obstacles: ObstacleSpec) -> Handle:
        """Put obstacles into the world; the times of a motion count from now.

        Raises SceneError for one that would be in the vehicle.
        """
        return self._from_here(self._ask(lambda: self._bench.place(*obstacles)))

    def hit(self, speed_m_s: float, bearing_deg: float = 0.0, elevation_deg: float = 0.0) -> str:
        """Swing a plate at the vehicle: it touches at that speed 20 ms from now, coming from there,
        clockwise from the nose (90 is the right) or from above (elevation 90). Returns the name the hit will have."""
        return self._ask(lambda: self._bench.hit(speed_m_s, bearing_deg, elevation_deg))

    def inject(self, fault: FaultRequest, for_s: float | None = None, after_s: float = 0.0) -> Handle:
        """Let something of `sim_vehicle.testing.faults` go wrong now, for a while or until it is removed."""
        return self._from_here(self._ask(lambda: self._bench.inject(fault, for_s, after_s)))

    def pause(self) -> None:
        """Let the vehicle's time and its telemetry stand still, as a paused simulator of PX4's does."""
        self._ask(lambda: setattr(self, "_is_paused", True))

    def resume(self) -> None:
        """Go on where it stood."""
        self._ask(self._go_on)

    def _go_on(self) -> None:
        self._is_paused = False
        if not self._flies:
            self._flies = True
            self._pace.restart(self.speed)
            self._thread.submit(self._fly)

    @property
    def is_paused(self) -> bool:
        return self._is_paused

    @property
    def speed(self) -> float:
        """How many times real time, at most; 0 for as fast as it goes. May be set at any time."""
        return self._pace.speed

    @speed.setter
    def speed(self, speed: float) -> None:
        _check(speed)
        self._ask(lambda: self._pace.restart(speed))

    def wait_until(self, condition: Condition, within_s: float) -> Truth:
        """Wait until a condition on the truth holds, looked at after each interval; return the truth of that moment.

        ``within_s`` is the vehicle's time. Raises ConditionNotMet. In an asynchronous test:
        `await asyncio.to_thread(vehicle.wait_until, ...)`.
        """
        if self.is_paused or self._is_in_thread:
            raise SimulationError("a vehicle that stands still waits for nothing: resume it, or leave its condition.")
        future: Future[Truth] = Future()

        def begin() -> None:
            until_us = self._bench.vehicle.time_boot_us + round(1e6 * within_s)
            refusal = f"the condition did not hold within {within_s:g} s (seed {self.setup.seed})."
            self._waiting.append(_Waiting(condition, until_us, ConditionNotMet(refusal), future))

        self._ask(begin)
        return future.result()

    # --- what a test reads -------------------------------------------------------------------------------

    @property
    def setup(self) -> Setup:
        """With what it began."""
        return self._bench.setup

    @property
    def truth(self) -> Truth:
        """What is really so at the end of the last interval."""
        return self._read(lambda: self._bench.truth)

    @property
    def recorded(self) -> TruthRecorder:
        """The whole flight: its path as arrays, all hits, all faults. It goes on growing until the vehicle stops."""
        return self._bench.recorded

    @property
    def timeline(self) -> tuple[TimelineEntry, ...]:
        """What has happened so far."""
        return self._read(lambda: self._bench.timeline)

    def save_truth(self, path: Path) -> None:
        """Write hits, faults and path as `.npz`, as `rebound sim --truth` does."""
        epoch_us = time.time_ns() // 1000 - self._bench.vehicle.time_boot_us
        self._read(lambda: save_truth(path, self._bench.vehicle.truth, epoch_us))

    # --- beginning and end -------------------------------------------------------------------------------

    def stop(self) -> None:
        """End the thread and give the ports back. Raises VehicleEnded if it had come to grief before."""
        with suppress(VehicleEnded):
            self._ask(self._end)
        self._thread.shutdown()
        problem, self._reported = self._problem if not self._reported else None, True
        if problem is not None:
            raise self._ended() from problem

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _begin(self) -> None:
        self._ident = threading.get_ident()
        self._pace.restart(self.speed)

    @property
    def _is_in_thread(self) -> bool:
        return threading.get_ident() == self._ident

    def _fly(self) -> None:
        """One interval, and the next after what is asked for meanwhile."""
        self._flies = not (self._is_paused or self._has_ended)
        if not self._flies:
            return
        try:
            serve_interval(self._bench.vehicle, self._ports, self._pace, self._advance)
        except Exception as problem:
            self._problem = problem
            self._end()
            return
        self._thread.submit(self._fly)

    def _advance(self) -> None:
        self._bench.step()
        if self._waiting:
            truth, now_us = self._bench.truth, self._bench.vehicle.time_boot_us
            self._waiting = [waiting for waiting in self._waiting if not waiting.is_over(truth, now_us)]

    def _end(self) -> None:
        """Nobody flies, waits or is listened to any more."""
        self._has_ended = True
        for port in self._ports:
            port.close()
        for waiting in self._waiting:
            waiting.future.set_exception(self._ended())
        self._ports, self._waiting = [], []

    def _ask(self, order: Callable[[], Answer]) -> Answer:
        """Let the vehicle's thread do it between two intervals."""
        if self._is_in_thread:
            # A condition that somebody waits for is looked at there.
            return order()
        try:
            future = self._thread.submit(self._unless_ended, order)
        except RuntimeError as problem:  # the thread takes nothing any more
            raise self._ended() from problem
        return future.result()

    def _unless_ended(self, order: Callable[[], Answer]) -> Answer:
        if self._has_ended:
            raise self._ended()
        return order()

    def _read(self, order: Callable[[], Answer]) -> Answer:
        """The same for what may be read after the end, too."""
        try:
            return self._ask(order)
        except VehicleEnded:
            return order()

    def _ended(self) -> VehicleEnded:
        if self._problem is not None:
            return VehicleEnded(f"the simulated vehicle came to grief: {self._problem!r}.")
        return VehicleEnded("the simulated vehicle has been stopped.")

    def _from_here(self, handle: Handle) -> Handle:
        return Handle(lambda: self._ask(handle.remove))
