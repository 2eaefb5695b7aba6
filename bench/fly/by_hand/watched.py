"""A vehicle, whoever watches it and a ground station on virtual time; impacts that are reported, beside the truth."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bench.fly.lockstep import Stepped
from bench.fly.station import GroundStation
from companion.companion import StepResult
from companion.guard.guard import Guard
from companion.motion.config import GRAVITY_M_S2
from companion.reflex.detection.detector import Impact, Phase
from companion.report import Status
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.vehicle import SimulatedVehicle

Row = dict[str, Any]

IMU_HZ = (50, 100, 250)
# More than any drawn vehicle's thrust, with a hover at a third of it, and drag.
STRONGEST_M_S2 = 45.0
# A ground station's sticks come at 25 to 50 Hz, its heartbeat once a second.
STICKS_S, BEAT_S = 0.02, 1.0


@dataclass(frozen=True, slots=True)
class Sticks:
    """From -1 to 1: right, forward, up and clockwise are positive."""

    roll: float = 0.0
    pitch: float = 0.0
    throttle: float = 0.0
    yaw: float = 0.0


@dataclass
class Watcher:
    """Who watches, and what was reported."""

    guard: Guard
    reported: list[Row] = field(default_factory=list)
    watched_s: float = 0.0
    impact: Impact | None = None  # the newest


class GuardedFlight(Stepped):
    """With a ground station. The world is the level ground alone."""

    def __init__(self, vehicle: SimulatedVehicle, *guards: Guard) -> None:
        super().__init__(vehicle, *guards)
        self.watchers = [Watcher(guard) for guard in guards]
        self.station = GroundStation(vehicle, LinkKind.NORMAL)
        for link in self.links:
            link.introduce()
        self._body, self._depth_m = vehicle.state.body, vehicle.state.depth_m
        self._sticks_s = self._beat_s = 0.0
        self._before = np.zeros(3)
        self.looks_for_ground = False  # once the vehicle is off it
        self.has_touched = False

    @property
    def status(self) -> Status:
        """As the first watcher sees it."""
        return self.watchers[0].guard.status()

    @property
    def height_m(self) -> float:
        """Of the centre of mass above the ground, true."""
        return -float(self._body[2])

    @property
    def velocity_ned_m_s(self) -> tuple[float, float, float]:
        north, east, down = self._body[3:6].tolist()
        return north, east, down

    @property
    def tilt_deg(self) -> float:
        """Of the body's vertical axis from the world's, true."""
        _, x, y, _ = self._body[6:10].tolist()
        return math.degrees(math.acos(max(-1.0, 1.0 - 2.0 * (x * x + y * y))))

    def fly_sticks(self, sticks: Callable[[], Sticks]) -> None:
        """Send the sticks where they are due."""
        if self.time_s < self._sticks_s:
            return
        self._sticks_s, now = self._sticks_s + STICKS_S, sticks()
        self.station.move_sticks(now.roll, now.pitch, now.throttle, now.yaw)

    def step(self) -> list[StepResult]:
        if self.time_s >= self._beat_s:
            self._beat_s = self.time_s + BEAT_S
            self.station.beat()
        self._before[:] = self._body[3:6]
        results = super().step()
        self.station.hear()
        self.has_touched |= self.looks_for_ground and self._is_touching()
        for watcher in self.watchers:
            self._note_impact(watcher)
        return results

    def _is_touching(self) -> bool:
        """A contact with a stiff frame may begin and end within an interval: its force shows it then."""
        change = (self._body[3:6] - self._before) / (1e-6 * self.vehicle.interval_us)
        change[2] -= GRAVITY_M_S2
        return float(self._depth_m.max()) > 0.0 or float(np.linalg.norm(change)) > STRONGEST_M_S2

    def _note_impact(self, watcher: Watcher) -> None:
        monitor = watcher.guard.core.reflex.monitor
        if monitor.state.phase is not Phase.OFF:
            watcher.watched_s += 1e-6 * self.vehicle.interval_us
        estimate = monitor.estimator.estimate
        if estimate is None or estimate.impact is watcher.impact:
            return
        watcher.impact = impact = estimate.impact
        watcher.reported.append(
            {
                "kind": impact.kind.value,
                "evidence": impact.evidence.value,
                "sample_s": round(1e-6 * impact.sample_time_boot_us, 3),
                "in_the_air": not self.has_touched,
                "tilt_deg": round(self.tilt_deg, 1),
                "turning_rad_s": round(math.hypot(*self._body[10:13].tolist()), 2),
                "speed_m_s": round(math.hypot(*self.velocity_ned_m_s[:2]), 2),
                "down_m_s": round(self.velocity_ned_m_s[2], 2),
                "height_m": round(self.height_m, 2),
                "force_frd_m_s2": [round(value, 1) for value in impact.specific_force_frd_m_s2],
                "threshold_m_s2": round(monitor.state.threshold_m_s2, 1),
                "mode": self.status.vehicle_mode,
            }
        )
