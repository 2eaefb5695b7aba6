"""One hit through the whole wire: a vehicle begins in flight, and a guard watches it into an obstacle and to rest.

What a mission's flight has besides, take-off, the way to the wall and the landing, decides nothing about its hit.
"""

import math

import numpy as np

from bench.cases.hits import POLE_OFFSET_SHARES, SPEEDS_M_S, HitCase, vehicle_of_hit
from bench.cases.vehicles import AIRFRAMES
from bench.fly.lockstep import Stepped
from bench.fly.wire import FOLLOWED_S, PATIENCE_S, on_its_way
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from sim_vehicle.physics.layout import HIT_ACTIVE
from sim_vehicle.vehicle import SimulatedVehicle

# What is met sideways; each as often as the others.
APPROACHES = ("wall", "slanted wall", "leaning wall", "pole")
# Asked for: every sample there is, and PX4's default onboard stream.
IMU_HZ = (250, 50)
# Until the obstacle is touched. The detector knows what a vehicle shakes after 1 s (`detection.floor`); meeting the
# vehicle takes 0.05 s. Twice as long changes nothing (bench/notes/decisions.md).
FREE_FLIGHT_S = (1.2, 1.4)
# Of the streams' rates, in place of 2 s: ten of the slowest stream that must arrive.
WINDOW_S = 0.5
# At rest: nothing touched, and slower than a hovering vehicle wanders by the worst estimate (0.08 m/s on each axis).
REST_M_S, REST_S = 0.2, 0.3
# A healthy recovery takes 2 to 4 s.
MOST_RECOVERY_S = 5.0
# A vehicle that leans by more is over.
OVERTURNED_DEG = 90.0
# How often the truth is looked at.
LOOK_EVERY = 5


def draw_flown(seed: int, is_drawn: bool, airframe: str | None = None) -> HitCase:
    """Airframes, but for one that is given, rates and approaches in turn, speeds at random."""
    speed_m_s = round(float(np.random.default_rng([seed, 0]).uniform(*SPEEDS_M_S)), 3)
    approach, imu_hz = APPROACHES[seed // 4 % len(APPROACHES)], IMU_HZ[seed // 2 % 2]
    return HitCase(seed, airframe or AIRFRAMES[seed % 2], approach, speed_m_s, is_drawn, imu_hz)


def fly(hit: HitCase) -> tuple[SimulatedVehicle, Guard, int | None]:
    """Steadily on the way, to rest or as long as may be; the boot time from which it rested."""
    built = vehicle_of_hit(hit)
    vehicle, _, free_s = on_its_way(hit, built.airframe, FREE_FLIGHT_S, POLE_OFFSET_SHARES[0])
    streams = {"highres_imu_hz": hit.imu_hz, "window_s": WINDOW_S}
    guard = Guard(GuardConfig.model_validate({"companion": {**built.settings, "streams": streams}}))
    flight = Stepped(vehicle, guard)
    flight.links[0].introduce()
    rest_us = to_rest(flight, guard, free_s + PATIENCE_S)
    return vehicle, guard, rest_us


def to_rest(flight: Stepped, guard: Guard, patience_s: float) -> int | None:
    """On until the vehicle rests, or as long as may be; the boot time from which it rested."""
    vehicle = flight.vehicle
    body, hit_row, truth = vehicle.state.body, vehicle.state.hit, vehicle.truth
    until_us, count = vehicle.time_boot_us + round(1e6 * patience_s), 0
    touched_us = rest_us = None
    is_answered = False
    while vehicle.time_boot_us < until_us:
        flight.step()
        now_us = vehicle.time_boot_us
        count += 1
        if count % LOOK_EVERY:
            continue
        touches = hit_row[HIT_ACTIVE] == 1.0
        if touched_us is None and (touches or truth.hits):
            touched_us, until_us = now_us, now_us + round(1e6 * FOLLOWED_S)
        if touched_us is not None and not is_answered and guard.core.flight.collisions:
            is_answered, until_us = True, touched_us + round(1e6 * MOST_RECOVERY_S)
        if not is_answered or touches or math.hypot(*body[3:6].tolist()) > REST_M_S:
            rest_us = None
        elif rest_us is None:
            rest_us = now_us
        elif now_us - rest_us >= 1e6 * REST_S:
            break
    else:
        rest_us = None
    return rest_us
