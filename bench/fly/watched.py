"""A vehicle, who watches it and a ground station; the truth of its first touch of the ground, and what was reported."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.fly.packets import GROUND_STATION, SET_MODE, made
from bench.fly.stepped import Stepped
from companion.companion import Companion, StepResult
from companion.guard.guard import Guard
from companion.motion.config import GRAVITY_M_S2
from companion.reflex.detector import Impact
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.vehicle import SimulatedVehicle

Row = dict[str, Any]

IMU_HZ = (50, 100, 250)
# Of PX4's modes, as DO_SET_MODE takes them: main and sub mode.
MODES = {"ALTCTL": (2, 0), "POSCTL": (3, 0), "AUTO.RTL": (4, 5), "AUTO.LAND": (4, 6), "STABILIZED": (7, 0)}
# More than any drawn vehicle's thrust, with a hover at a third of it, and drag.
STRONGEST_M_S2 = 45.0
# A ground station's sticks come at 25 to 50 Hz, its heartbeat once a second.
STICKS_S, BEAT_S = 0.02, 1.0
# The middle of the throttle's way from 0 to 1000, and the other sticks' from -1000 to 1000.
HALF_THROTTLE, FULL_STICK = 500, 1000


@dataclass(frozen=True, slots=True)
class Sticks:
    """From -1 to 1: right, forward and up are positive."""

    roll: float = 0.0
    pitch: float = 0.0
    throttle: float = 0.0


class WatchedFlight(Stepped):
    """The world is the level ground alone."""

    def __init__(self, vehicle: SimulatedVehicle, program: Companion | Guard) -> None:
        super().__init__(vehicle, program)
        self.program = program
        self.reported: list[Row] = []
        self._newest: Impact | None = None
        self._station = vehicle.add_link(LinkKind.NORMAL)
        self.links[0].introduce()
        self._body, self._depth_m = vehicle.state.body, vehicle.state.depth_m
        self._sent, self._sticks_s, self._beat_s = 0, 0.0, 0.0
        self._before = np.zeros(3)
        self.looks_for_ground = False
        """Whether a touch of the ground counts: the vehicle is off it."""
        self.touched_us: int | None = None
        self.hardest_m_s2 = 0.0
        """Since that touch: the largest specific force, mean over an interval."""
        self.hardest_us: int | None = None
        self.tilt_at_touch_deg = self.sink_at_touch_m_s = 0.0

    @property
    def mode(self) -> str | None:
        """The vehicle's, as the program knows it."""
        return self.program.status().vehicle_mode

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

    def ask_mode(self, mode: str) -> None:
        """By a ground station."""
        main, sub = MODES[mode]
        asked = {"command": SET_MODE, "param1": 1.0, "param2": main, "param3": sub}
        self._push("COMMAND_LONG", target_system=1, target_component=1, **asked)

    def fly_sticks(self, sticks: Callable[[], Sticks]) -> None:
        """Send the sticks where they are due."""
        if self.time_s < self._sticks_s:
            return
        self._sticks_s, now = self._sticks_s + STICKS_S, sticks()
        x, y = (round(FULL_STICK * limited(stick)) for stick in (now.pitch, now.roll))
        self._push("MANUAL_CONTROL", target=1, x=x, y=y, z=round(HALF_THROTTLE * (1.0 + limited(now.throttle))))

    def step(self) -> list[StepResult]:
        if self.time_s >= self._beat_s:
            self._beat_s = self.time_s + BEAT_S
            self._push("HEARTBEAT", type=6, autopilot=8)
        self._before[:] = self._body[3:6]
        results = super().step()
        self._station.take()
        if self.looks_for_ground:
            self._note_ground()
        self._note_impact()
        return results

    def _note_ground(self) -> None:
        """A contact with a stiff frame may begin and end within an interval: its force shows it then."""
        now_us = self.vehicle.time_boot_us
        change = (self._body[3:6] - self._before) / (1e-6 * self.vehicle.interval_us)
        change[2] -= GRAVITY_M_S2
        force_m_s2 = float(np.linalg.norm(change))
        if self.touched_us is None and (float(self._depth_m.max()) > 0.0 or force_m_s2 > STRONGEST_M_S2):
            self.touched_us = now_us
            self.tilt_at_touch_deg, self.sink_at_touch_m_s = self.tilt_deg, float(self._before[2])
        if self.touched_us is not None and force_m_s2 > self.hardest_m_s2:
            self.hardest_m_s2, self.hardest_us = force_m_s2, now_us

    def _note_impact(self) -> None:
        core = self.program.core
        estimate = None if core is None else core.reflex.monitor.estimator.estimate
        if estimate is None or estimate.impact is self._newest:
            return
        self._newest = impact = estimate.impact
        self.reported.append(
            {
                "kind": impact.kind.value,
                "evidence": impact.evidence.value,
                "sample_s": round(1e-6 * impact.sample_time_boot_us, 3),
                "tilt_deg": round(self.tilt_deg, 1),
                "down_m_s": round(self.velocity_ned_m_s[2], 2),
                "height_m": round(self.height_m, 2),
                "mode": self.mode,
            }
        )

    def _push(self, name: str, **fields: Any) -> None:
        self._sent += 1
        self._station.push(made(name, fields, GROUND_STATION, self._sent % 256))


def limited(stick: float) -> float:
    return min(max(stick, -1.0), 1.0)
