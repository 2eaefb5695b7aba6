"""A vehicle under test: what may be done to it between two intervals, and what a test may read. No clock, no socket.

`LockstepVehicle` flies it on virtual time: bytes in, bytes out, the same bits every time, as fast as the machine goes.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any

from pydantic import ValidationError

from sim_vehicle.airframe import Airframe, load_airframe
from sim_vehicle.bench.faults import FaultRequest, opposite
from sim_vehicle.bench.strike import DURATION_S, THICKNESS_M, strike
from sim_vehicle.bench.truth import Timeline, TimelineEntry, Truth, truth_of
from sim_vehicle.errors import ConditionNotMet, FaultError, ParameterError, SceneError
from sim_vehicle.faults.spec import Fault
from sim_vehicle.mavlink.streams.stream_rates import link_kind
from sim_vehicle.obstacles import BoxSpec, PoleSpec, WallSpec
from sim_vehicle.parameters.store import definitions
from sim_vehicle.scene import Scene, Start
from sim_vehicle.vehicle import SimulatedVehicle
from sim_vehicle.world import Obstacle

ObstacleSpec = WallSpec | PoleSpec | BoxSpec
Condition = Callable[[Truth], Any]


@dataclass(frozen=True, slots=True)
class Setup:
    """With what a vehicle begins; every part has a default."""

    airframe: str | Airframe = "foldable"
    """A built-in one's name, or one of your own."""
    obstacles: Sequence[ObstacleSpec] = ()
    seed: int = 1
    wind_ned_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    faults: Sequence[Mapping[str, Any]] = ()
    """As a mission file's `sim.faults`: with `at_s` or `between_s` by the vehicle's clock."""
    yaw_deg: float = 0.0
    parameters: Mapping[str, float] = field(default_factory=dict)
    """In place of PX4's defaults and the airframe's."""

    def scene(self) -> Scene:
        """The world as a mission file would state it. Raises SceneError."""
        kinds = {"walls": WallSpec, "poles": PoleSpec, "boxes": BoxSpec}
        parts = {name: tuple(spec for spec in self.obstacles if isinstance(spec, kind)) for name, kind in kinds.items()}
        if sum(map(len, parts.values())) < len(self.obstacles):
            raise SceneError("obstacles are each a Wall, a Pole or a Box of sim_vehicle.testing.")
        others = {"seed": self.seed, "wind_ned_m_s": self.wind_ned_m_s, "faults": tuple(self.faults)}
        try:
            return Scene.model_validate({"start": Start(yaw_deg=self.yaw_deg), **others, **parts})
        except ValidationError as problem:
            first = problem.errors()[0]
            raise SceneError(f"{'.'.join(str(part) for part in first['loc'])}: {first['msg']}.") from problem

    def parameters_checked(self) -> dict[str, float]:
        """Raises ParameterError for a name that there is not, and for what is no number of a parameter."""
        for name, value in self.parameters.items():
            if name not in definitions():
                raise ParameterError(f"the vehicle has no parameter {name!r}; see sim_vehicle/parameters/px4.csv.")
            if not -(2**31) <= value < 2**31:
                raise ParameterError(f"{name} cannot be {value:g}: a parameter has 32 bits.")
        return {name: int(v) if definitions()[name].is_whole else float(v) for name, v in self.parameters.items()}

    def airframe_loaded(self) -> Airframe:
        """Raises AirframeError for a name that there is not, and for a file that is none."""
        return self.airframe if isinstance(self.airframe, Airframe) else load_airframe(self.airframe)


class Handle(ExitStack):
    """Something that was placed or injected: `remove()` takes it back, and so does the end of a `with` block."""

    def __init__(self, take_back: Callable[[], None]) -> None:
        super().__init__()
        self.callback(take_back)

    def remove(self) -> None:
        """From now on it is not there; once is enough, more do no harm."""
        self.close()


class Bench:
    """A vehicle, its changes and its timeline. The same calls between the same intervals give the same bits."""

    def __init__(self, setup: Setup, epoch_at_boot_us: int = 0) -> None:
        """Raises AirframeError, SceneError and ParameterError."""
        self.setup = setup
        self.vehicle = SimulatedVehicle(
            setup.airframe_loaded(),
            setup.scene(),
            setup.seed,
            epoch_at_boot_us=epoch_at_boot_us,
            parameters=setup.parameters_checked(),
            links_may_fail=True,
        )
        self.recorded = self.vehicle.truth
        """The whole flight: its path as arrays, all hits, all faults."""
        self._timeline = Timeline(self.vehicle)
        self._placed = len(setup.obstacles)
        self._strikes = 0
        self._due: list[tuple[int, Callable[[], None]]] = []

    @property
    def time_s(self) -> float:
        """The vehicle's clock, seconds since boot."""
        return self.vehicle.time_boot_us / 1e6

    @property
    def truth(self) -> Truth:
        """What is really so at this moment."""
        return truth_of(self.vehicle)

    @property
    def timeline(self) -> tuple[TimelineEntry, ...]:
        """What has happened so far."""
        return self._timeline.events

    def step(self) -> None:
        """One interval."""
        while self._due and self._due[0][0] <= self.vehicle.time_boot_us:
            self._due.pop(0)[1]()
        self.vehicle.advance()
        self._timeline.look()

    def place(self, *specs: ObstacleSpec) -> Handle:
        """Put obstacles into the world; the times of a motion count from now.

        Raises SceneError for one that would be in the vehicle.
        """
        obstacles = tuple(self._built(spec, self._placed + number) for number, spec in enumerate(specs, start=1))
        self.vehicle.place(obstacles)
        self._placed += len(obstacles)
        names = ", ".join(f"'{obstacle.name}'" for obstacle in obstacles)
        self._timeline.note(f"placed {names}")
        return Handle(lambda: self._take_away(obstacles, names))

    def hit(self, speed_m_s: float, bearing_deg: float = 0.0, elevation_deg: float = 0.0) -> str:
        """Swing a plate at the vehicle: it touches at that speed 20 ms from now, coming from there,
        clockwise from the nose (90 is the right) or from above (elevation 90). Returns the name the hit will have.

        The speed is against the vehicle as it moves now. Raises SceneError for what is no speed or angle.
        """
        vehicle = self.vehicle
        # A faster plate would be through itself between two looks at what is near.
        fastest_m_s = 1e6 * THICKNESS_M / vehicle.constants.raw_interval_us
        if not (0.0 < speed_m_s <= fastest_m_s and math.isfinite(bearing_deg + elevation_deg)):
            needed = f"angles and a speed above 0 up to {fastest_m_s:g} m/s"
            raise SceneError(f"a hit needs {needed}, not {speed_m_s:g} m/s.")
        self._strikes += 1
        name = f"strike {self._strikes}"
        plate = strike(vehicle.state, vehicle.constants, speed_m_s, bearing_deg, elevation_deg, name)
        vehicle.put((plate,))
        above = f", {elevation_deg:g} deg up" if elevation_deg else ""
        self._timeline.note(f"{name} swung: {speed_m_s:g} m/s from {bearing_deg:g} deg{above}")
        self._due.append((vehicle.time_boot_us + round(1e6 * DURATION_S), lambda: vehicle.remove((plate,))))
        return name

    def inject(self, request: FaultRequest, for_s: float | None = None, after_s: float = 0.0) -> Handle:
        """Let something of `sim_vehicle.testing.faults` go wrong now, or ``after_s`` later, for a while or until it is
        removed. Raises FaultError.
        """
        if not after_s >= 0.0:
            raise FaultError(f"{request.kind}: after_s must not be less than 0.")
        faults = request.timed(self.time_s + after_s, for_s)
        for fault in faults:
            self.vehicle.add_fault(fault)
        return Handle(lambda: self._end(faults))

    def _end(self, faults: tuple[Fault, ...]) -> None:
        """End faults; what has already jumped jumps back."""
        vehicle, now_s = self.vehicle, self.time_s
        # One that happened once, and, where it was to be undone by itself, its opposite.
        happened = sum(fault.window_s[0] < now_s for fault in faults)
        undoing = opposite(faults[0], now_s) if happened == 1 else None
        for fault in faults:
            vehicle.remove_fault(fault)
        if undoing is not None:
            vehicle.add_fault(undoing)

    def _take_away(self, obstacles: tuple[Obstacle, ...], names: str) -> None:
        self.vehicle.remove(obstacles)
        self._timeline.note(f"removed {names}")

    def _built(self, spec: ObstacleSpec, number: int) -> Obstacle:
        obstacle = spec.built(number)
        motion = obstacle.motion
        return obstacle if motion is None else replace(obstacle, motion=motion.later(self.time_s))


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
        if not 0.0 <= seconds < math.inf:
            raise ValueError(f"time advances by seconds, from 0 on, not by {seconds!r}")
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
