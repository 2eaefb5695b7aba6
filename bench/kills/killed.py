"""One flight into a wall with many ends: at each kill a copy of it goes on without the companion. By the truth."""

import json
import math
import os
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from bench.campaign.plan import Campaign, Json
from bench.recoveries.hits import AIRFRAMES, into_a_wall
from companion.companion import Companion
from companion.mission.model import Mission
from rebound_cli.inputs import with_guards
from rebound_cli.simulation.lockstep import EPOCH_US, virtual_time_limit_s
from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit
from sim_vehicle.vehicle import SimulatedVehicle

SPEEDS_M_S = (0.7, 5.0)
# From before the touch to after it.
KILLED_S = (-0.3, 1.5)
KILLS_A_FLIGHT = 10
IMU_HZ = (250, 50)
MOST_SLANT_DEG = 45.0
HEIGHT_M = 1.5
# A landing from this height takes 5 s; what is not down by then has another trouble, which is told.
WATCHED_S = 12.0
# Closer than this to how it stands, a vehicle is on the ground.
STANDS_M = 0.03
# How long a vehicle that keeps its companion is followed after the last instant: what follows then is the next item's.
WITH_IT_S = 1.5


@dataclass(frozen=True, slots=True)
class Case:
    """A flight, and when after the first touch its companion is killed."""

    airframe: str
    imu_hz: int
    speed_m_s: float
    slant_deg: float
    seed: int
    kills_s: tuple[float, ...]


def kills_campaign(kills: int, first_seed: int) -> Campaign:
    parameters = {"kills": kills, "first_seed": first_seed}
    return Campaign("kills", parameters, cases(kills, first_seed), work_out, ("bench.recoveries",))


def cases(kills: int, first_seed: int) -> list[Case]:
    """Airframes and IMU rates in turn; all else as the seed draws it."""
    found: list[Case] = []
    for number in range(math.ceil(kills / KILLS_A_FLIGHT)):
        seed = first_seed + number
        draw = random.Random(seed)
        speed_m_s, slant_deg = draw.uniform(*SPEEDS_M_S), draw.uniform(-MOST_SLANT_DEG, MOST_SLANT_DEG)
        count = min(KILLS_A_FLIGHT, kills - KILLS_A_FLIGHT * number)
        instants_s = tuple(round(draw.uniform(*KILLED_S), 3) for _ in range(count))
        airframe, imu_hz = AIRFRAMES[number % 2], IMU_HZ[number // 2 % 2]
        found.append(Case(airframe, imu_hz, round(speed_m_s, 3), round(slant_deg, 1), seed, instants_s))
    return found


def mission_data(case: Case) -> dict[str, Any]:
    """With the case's IMU rate; nobody knows of the wall."""
    data = into_a_wall("kills", case.speed_m_s, case.slant_deg, HEIGHT_M)
    data["companion"]["streams"] = {"highres_imu_hz": case.imu_hz}
    return data


class SimulatedFlight:
    """The mission beside the simulated vehicle, interval by interval."""

    def __init__(self, case: Case) -> None:
        airframe: Airframe = load_built_in(case.airframe)
        self.mission = Mission.model_validate(with_guards(mission_data(case), airframe))
        scene = Scene.model_validate({**(self.mission.sim or {}), "airframe": case.airframe, "seed": case.seed})
        self.standing_m = airframe.geometry.foot_depth_m
        self.companion, self.vehicle = Companion(self.mission), SimulatedVehicle(airframe, scene, case.seed)
        self.companion.confirm_plan()
        self._pending = b""

    def fly_until(self, boot_us: float) -> None:
        """With the companion; its last packets are on their way."""
        while self.vehicle.time_boot_us < boot_us and not self.companion.finished:
            self.fly()

    def fly(self) -> None:
        frames = self.vehicle.step(self._pending)
        now_us = EPOCH_US + self.vehicle.time_boot_us
        self._pending = b"".join(self.companion.step(b"".join(frames), now_us).sent_frames)

    def fall(self) -> None:
        """Without the companion, until the vehicle is on the ground."""
        until_us = self.vehicle.time_boot_us + WATCHED_S * 1e6
        while self.vehicle.time_boot_us < until_us and not self.is_down:
            self.vehicle.step(self._pending)
            self._pending = b""

    @property
    def is_down(self) -> bool:
        return float(self.vehicle.truth.series()["position_ned_m"][-1, 2]) > -self.standing_m - STANDS_M


def work_out(case: Case) -> Json:
    """Every kill of a flight, and what the same flight does when nobody is killed."""
    first = SimulatedFlight(case)
    limit_us = virtual_time_limit_s(first.mission) * 1e6
    while not first.vehicle.truth.hits and first.vehicle.time_boot_us < limit_us and not first.companion.finished:
        first.fly()
    if not first.vehicle.truth.hits:
        raise AssertionError("the vehicle never reached the wall")
    touch = first.vehicle.truth.hits[0]
    flight, killed = SimulatedFlight(case), []
    for kill_s in sorted(case.kills_s):
        flight.fly_until(touch.contact_at_boot_us + kill_s * 1e6)
        killed.append(_in_a_copy(lambda: _killed(flight, touch)))
    flight.fly_until(touch.contact_at_boot_us + 1e6 * (KILLED_S[1] + WITH_IT_S))
    again_m_s = _hardest(flight.vehicle.truth.hits[1:])
    return {"touch_m_s": touch.closing_speed_m_s, "again_m_s": again_m_s, "kills": killed}


def _in_a_copy(work: Callable[[], Json]) -> Json:
    """What a copy of this process makes of it: the flight goes on here as if nothing had been done."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.write(writing, json.dumps(work()).encode())
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        text = pipe.read()
    os.waitpid(child, 0)
    found: Json = json.loads(text)
    return found


def _killed(flight: SimulatedFlight, touch: Hit) -> Json:
    killed_at_us = flight.vehicle.time_boot_us
    since_s = 1e-6 * (killed_at_us - touch.contact_at_boot_us)
    flight.fall()
    truth = flight.vehicle.truth
    # The touch itself is no second one, whenever it came.
    later = [hit for hit in truth.hits if hit.contact_at_boot_us >= killed_at_us][1 if since_s < 0.0 else 0 :]
    return {
        "kill_s": since_s,
        "again_m_s": _hardest(later),
        "ground_m_s": math.hypot(*truth.series()["velocity_ned_m_s"][-1]) if flight.is_down else None,
    }


def _hardest(hits: Sequence[Hit]) -> float:
    """0 where there is none."""
    return max((hit.closing_speed_m_s for hit in hits), default=0.0)
