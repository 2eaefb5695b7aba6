"""A pilot who flies a healthy vehicle hard: take-off, manoeuvres one after the other, landing. No obstacle anywhere.

Each manoeuvre is a generator that is resumed once an interval and says what is asked of the vehicle in it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from companion.messages import LandedState
from companion.mission.trajectory import LineProfile
from sim_vehicle.airframe import Airframe
from sim_vehicle.control.setpoint import FREE, RatesSetpoint, Setpoint, TrajectorySetpoint
from sim_vehicle.plant.plant import Plant
from sim_vehicle.quantities import Vector3

# A companion's setpoints come at 50 Hz: one in five intervals of 4 ms.
SETPOINT_EVERY = 5
# The flights stay in a block of air: above any loss of height in a flip, not so far that floats become coarse.
FLOOR_M, CEILING_M, RADIUS_M = 10.0, 40.0, 60.0
TAKEOFF_M = 2.0
# Below this the feet are on the ground.
TOUCH_MARGIN_M = 0.01
# PX4's land detector says "landed" about a second after the touch.
LANDED_AFTER_S = 1.0
FLIP_RATE_RAD_S = 12.0
FLIP_THRUST = 0.5

Manoeuvre = Iterator["PilotDemand"]


@dataclass(frozen=True, slots=True)
class PilotDemand:
    """What is asked of the vehicle in an interval (None: idling motors), and what the flight knows about it."""

    phase: str
    setpoint: Setpoint | None = None
    armed: bool = True
    landed_state: LandedState = LandedState.IN_AIR
    off_reason: str | None = None

    @property
    def position_ned_m(self) -> Any:
        """The setpoint's, as a companion that sent it knows it: None unless all of it was given."""
        position = getattr(self.setpoint, "position_ned_m", FREE)
        return None if None in position else position


class Pilot:
    """Plans from where the vehicle really is. `asked_ned_m` is the latest position asked for."""

    def __init__(self, plant: Plant, airframe: Airframe, rng: np.random.Generator, duration_s: float) -> None:
        self._body = plant.state.body
        self._airframe, self._rng = airframe, rng
        self._step_s = 1e-6 * plant.interval_us
        self._duration_s = duration_s
        self.asked_ned_m: Vector3 = (0.0, 0.0, 0.0)
        self._yaw_rad = 0.0

    def fly(self) -> Manoeuvre:
        """Everything from the ground to the ground."""
        yield from self._stand(0.6)
        yield from self._take_off()
        flown_s, manoeuvres = 0.0, (self._dash, self._jump, self._stop, self._slalom, self._spin, self._hover)
        yield from self._line("climb", self._anywhere(), 2.5, 2.0)
        while flown_s < self._duration_s:
            choice = int(self._rng.integers(len(manoeuvres) + 1))
            chosen = self._flip if choice == len(manoeuvres) else manoeuvres[choice]
            for asked in chosen():
                flown_s += self._step_s
                yield asked
        yield from self._land()

    # --- on the ground --------------------------------------------------------------------------------------------

    def _stand(self, seconds: float) -> Manoeuvre:
        for _ in range(self._intervals(seconds)):
            yield PilotDemand("ground", landed_state=LandedState.ON_GROUND, off_reason="ready")

    def _take_off(self) -> Manoeuvre:
        for asked in self._line("takeoff", (0.0, 0.0, -TAKEOFF_M - 1.0), float(self._rng.uniform(0.7, 1.5)), 1.0):
            yield PilotDemand(asked.phase, asked.setpoint, landed_state=LandedState.TAKEOFF, off_reason="takeoff")

    def _land(self) -> Manoeuvre:
        """Over a free spot, down at a speed of ordinary landings, motors off a while after the touch."""
        north, east, _ = self._position()
        yield from self._line("descend", (north, east, -3.0), 1.4, 1.0)
        speed_m_s = float(self._rng.uniform(0.3, 1.4))
        resting_m = -self._airframe.geometry.foot_depth_m
        on_ground = landed = 0
        setpoint = None
        while landed < self._intervals(LANDED_AFTER_S):
            if on_ground % SETPOINT_EVERY == 0:
                x, y, _ = self.asked_ned_m
                setpoint = TrajectorySetpoint((x, y, None), (0.0, 0.0, speed_m_s), FREE, self._yaw_rad)
            on_ground += 1
            landed += self._position()[2] > resting_m - TOUCH_MARGIN_M
            yield PilotDemand("landing", setpoint, landed_state=LandedState.LANDING)
        for armed in (True, False):
            for _ in range(self._intervals(0.6)):
                yield PilotDemand("landed", None, armed, landed_state=LandedState.ON_GROUND)

    # --- in the air -----------------------------------------------------------------------------------------------

    def _dash(self) -> Manoeuvre:
        """A companion's leg: a line with ramps, at speeds up to the vehicle's own."""
        yield from self._line("dash", self._anywhere(), self._uniform(1.0, 8.0), self._uniform(1.0, 5.0))

    def _jump(self) -> Manoeuvre:
        """A position far off at once: full tilt, and full tilt back."""
        target = self._anywhere(within_m=12.0)
        yield from self._hold("jump", TrajectorySetpoint(target, FREE, FREE, self._yaw_rad), self._uniform(2.0, 5.0))

    def _stop(self) -> Manoeuvre:
        """Full speed, then nothing: the hardest stop there is."""
        heading, speed_m_s = self._uniform(-math.pi, math.pi), self._uniform(2.0, 8.0)
        velocity = (speed_m_s * math.cos(heading), speed_m_s * math.sin(heading), 0.0)
        yield from self._hold("start", self._at_velocity(velocity), self._uniform(1.5, 3.0))
        yield from self._hold("stop", self._at_velocity((0.0, 0.0, 0.0)), 2.0)

    def _slalom(self) -> Manoeuvre:
        """Sideways, to and fro, up and down, faster than the vehicle can follow."""
        heading, speed_m_s = self._uniform(-math.pi, math.pi), self._uniform(1.0, 4.0)
        for turn in range(6):
            side = speed_m_s if turn % 2 else -speed_m_s
            climb = self._uniform(-2.0, 1.2)
            velocity = (side * math.cos(heading), side * math.sin(heading), climb)
            yield from self._hold("slalom", self._at_velocity(velocity), self._uniform(0.4, 1.0))

    def _spin(self) -> Manoeuvre:
        """Turning about the vertical on the way."""
        rate_rad_s, heading = self._uniform(-3.0, 3.0), self._uniform(-math.pi, math.pi)
        speed_m_s = self._uniform(0.0, 4.0)
        velocity = (speed_m_s * math.cos(heading), speed_m_s * math.sin(heading), 0.0)
        setpoint = TrajectorySetpoint(FREE, velocity, FREE, None, rate_rad_s)
        yield from self._hold("spin", setpoint, self._uniform(2.0, 4.0))

    def _hover(self) -> Manoeuvre:
        place = TrajectorySetpoint(self._position(), FREE, FREE, self._yaw_rad)
        yield from self._hold("hover", place, self._uniform(1.0, 4.0))

    def _flip(self) -> Manoeuvre:
        """Once round about roll or pitch at a rate, then caught by the position control."""
        yield from self._line("climb", self._anywhere(floor_m=0.5 * (FLOOR_M + CEILING_M)), 3.0, 2.0)
        axis = int(self._rng.integers(2))
        rate_rad_s = FLIP_RATE_RAD_S if self._rng.random() < 0.5 else -FLIP_RATE_RAD_S
        setpoint = RatesSetpoint((0.0, rate_rad_s, 0.0) if axis else (rate_rad_s, 0.0, 0.0), FLIP_THRUST)
        turned_rad = 0.0
        for _ in range(self._intervals(2.0)):
            turned_rad += abs(float(self._body[10 + axis])) * self._step_s
            # The rest of the turn is left to the attitude control, which then takes the short way.
            if turned_rad > 1.7 * math.pi:
                break
            yield PilotDemand("flip", setpoint)
        yield from self._hold("caught", self._at_velocity((0.0, 0.0, 0.0)), 2.5)

    # --- how ------------------------------------------------------------------------------------------------------

    def _line(self, phase: str, target_ned_m: Vector3, speed_m_s: float, acceleration_m_s2: float) -> Manoeuvre:
        profile = LineProfile(self._position(), target_ned_m, speed_m_s, acceleration_m_s2)
        setpoint = None
        for count in range(self._intervals(profile.duration_s + 0.5)):
            if count % SETPOINT_EVERY == 0:
                position, velocity, acceleration = profile.at(count * self._step_s)
                self.asked_ned_m = position
                setpoint = TrajectorySetpoint(position, velocity, acceleration, self._yaw_rad)
            yield PilotDemand(phase, setpoint)

    def _hold(self, phase: str, setpoint: TrajectorySetpoint, seconds: float) -> Manoeuvre:
        for _ in range(self._intervals(seconds)):
            yield PilotDemand(phase, setpoint)
        self.asked_ned_m = self._position()

    def _at_velocity(self, velocity_ned_m_s: Vector3) -> TrajectorySetpoint:
        """Turned inwards where it would leave the block of air."""
        x, y, z = velocity_ned_m_s
        north, east, down = self._position()
        if math.hypot(north, east) > RADIUS_M and north * x + east * y > 0.0:
            x, y = -x, -y
        if (down > -FLOOR_M and z > 0.0) or (down < -CEILING_M and z < 0.0):
            z = -z
        return TrajectorySetpoint(FREE, (x, y, z), FREE, self._yaw_rad)

    def _anywhere(self, within_m: float | None = None, floor_m: float | None = None) -> Vector3:
        """A place in the block of air, at most so far away (sideways) from here."""
        north, east, _ = self._position()
        heading, far_m = self._uniform(-math.pi, math.pi), self._uniform(2.0, (within_m or RADIUS_M) / 2.0)
        x, y = north + far_m * math.cos(heading), east + far_m * math.sin(heading)
        shrink = min(1.0, RADIUS_M / max(math.hypot(x, y), 1e-9))
        return shrink * x, shrink * y, -self._uniform(floor_m or FLOOR_M, CEILING_M)

    def _position(self) -> Vector3:
        x, y, z = self._body[0:3].tolist()
        return x, y, z

    def _uniform(self, low: float, high: float) -> float:
        return float(self._rng.uniform(low, high))

    def _intervals(self, seconds: float) -> int:
        return round(seconds / self._step_s)
