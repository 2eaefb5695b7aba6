"""`bench hand`: drawn vehicles flown hard by sticks, with nothing to run into; every impact reported is false."""

import math
from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from bench.cases.vehicles import AIRFRAMES, vehicle_of
from bench.fly.by_hand.hand_pilot import Pilot, wishes
from bench.fly.by_hand.watched import IMU_HZ, STICKS_S, GuardedFlight, Row
from bench.fly.campaign import Results
from bench.rows.tables import at_most_an_hour, by_each
from bench.studies.study import Shown, run_study, seeds_of
from companion.autopilot.known import GUARDED_MODES
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from sim_vehicle.airframe import Airframe
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle

HAND_MODES = ("POSCTL", "ALTCTL", "STABILIZED")
# Limits as a pilot of a racer sets them. PX4's own: 35 deg, 3 m/s^2, 8 m/s^3, 100 deg/s.
TILT_DEG, JERK_M_S3, ACCELERATION_M_S2 = (30.0, 45.0), (30.0, 200.0), (6.0, 12.0)
SPEED_M_S, CLIMB_M_S, SINK_M_S, YAW_DEG_S = (5.0, 12.0), (2.0, 5.0), (1.5, 4.0), (90.0, 200.0)
# Half of the vehicles know where they are by a filter, the others with errors that are drawn.
FILTER_SHARE = 0.5
# Of the greatest thrust, at the steepest tilt: the rest turns the vehicle.
THRUST_LEFT = 0.95


@dataclass(frozen=True, slots=True)
class HandCase:
    """One flight; everything that is not here is drawn from the seed."""

    seed: int
    mode: str


def run_hand(options: Namespace) -> int:
    """0 when nothing was reported in the air, else 1."""
    cases = [HandCase(seed, HAND_MODES[seed % len(HAND_MODES)]) for seed in seeds_of(options, options.flights)]
    return run_study(options, "hand", "Flown hard by hand", cases, fly_by_hand, shown)


def shown(results: Results) -> Shown:
    rows = results.rows()
    # A row for each of the guards of each flight.
    watched = [{**row, **guarded} for row in rows for guarded in row["watched"]]
    text = text_of(watched)
    return Shown({"": text}, text, pd.DataFrame(rows), is_met=not any(map(_in_the_air, watched)))


# --- what is met in the air and is no collision

Faults = list[dict[str, Any]]
# Seconds of the vehicle's clock between which gusts begin, and how many.
GUSTS_FROM_S, GUSTS_UNTIL_S, GUSTS = 20.0, 95.0, 6


def _gusts(rng: np.random.Generator) -> Faults:
    """Up to 8 m/s from any side within a fifth of a second to a second."""
    faults = []
    for start_s in sorted(rng.uniform(GUSTS_FROM_S, GUSTS_UNTIL_S, GUSTS).tolist()):
        side, speed_m_s = rng.uniform(-math.pi, math.pi), rng.uniform(3.0, 8.0)
        velocity = [speed_m_s * math.cos(side), speed_m_s * math.sin(side), rng.uniform(-2.0, 2.0)]
        lasts_s, rise_s = float(rng.uniform(1.0, 5.0)), float(rng.uniform(0.2, 1.0))
        span = [start_s, start_s + max(lasts_s, 2.1 * rise_s)]
        faults.append({"kind": "gust", "between_s": span, "velocity_ned_m_s": velocity, "rise_s": rise_s})
    return faults


def _vibration(rng: np.random.Generator) -> Faults:
    """From a good vehicle's to a bent propeller's, which reaches the sensor's range again and again.

    From take-off on: a blade that breaks in the air is no healthy flight any more, and its first jolt is a hit's.
    """
    fault = {
        "kind": "vibration",
        "at_s": 0.0,
        "accelerometer_rms_m_s2": float(10.0 ** rng.uniform(0.3, 1.9)),
        "gyroscope_rms_rad_s": float(10.0 ** rng.uniform(-1.5, -0.3)),
        "motor_hz": float(rng.uniform(80.0, 220.0)),
    }
    return [fault | ({"motor": int(rng.integers(4))} if rng.random() < 0.5 else {})]


AIR: dict[str, Callable[[np.random.Generator], Faults]] = {
    "calm": lambda rng: [],
    "gusts": _gusts,
    "turbulence": lambda rng: [{"kind": "turbulence", "wind_20ft_m_s": float(rng.uniform(4.0, 12.0)), "at_s": 0.0}],
    "vibration": _vibration,
}


# --- the vehicle


def fly_by_hand(case: HandCase) -> Row:
    """Take-off by hand, a minute of vigorous flight, and all that guards at every IMU rate reported in it."""
    rng = np.random.default_rng([case.seed, 11])
    built = vehicle_of(AIRFRAMES[case.seed // 4 % 2], case.seed)
    airframe, parameters = agile(built.airframe, rng)
    air = str(rng.choice(list(AIR)))
    scene = Scene.model_validate({"faults": AIR[air](rng)})
    vehicle = SimulatedVehicle(airframe, scene, case.seed, keeps_path=False, parameters=parameters)
    guards = [_guard({**built.settings, "streams": {"highres_imu_hz": float(hz)}}) for hz in IMU_HZ]
    flight = GuardedFlight(vehicle, *guards)
    tilts = Pilot(flight, airframe, parameters, wishes(rng), case.mode).fly()
    return {
        "seed": case.seed,
        "airframe": airframe.name,
        "mode": case.mode,
        "estimate": airframe.estimate.kind,
        "air": air,
        "flown_s": round(len(tilts) * STICKS_S, 1),
        "tilt_deg": [round(float(np.percentile(tilts, at)), 1) for at in (50, 90, 100)] if tilts else [],
        "touched": flight.has_touched,
        "watched": [
            {"imu_hz": imu_hz, "watched_s": round(watcher.watched_s, 1), "reported": watcher.reported}
            for imu_hz, watcher in zip(IMU_HZ, flight.watchers, strict=True)
        ],
    }


def _guard(settings: Mapping[str, Any]) -> Guard:
    """It watches manual flight, too; with these settings of the companion."""
    return Guard(GuardConfig.model_validate({"modes": (*GUARDED_MODES, "STABILIZED"), "companion": settings}))


def agile(airframe: Airframe, rng: np.random.Generator) -> tuple[Airframe, dict[str, float]]:
    """The drawn vehicle with the limits of somebody who flies hard, and its parameters."""
    steepest_deg = math.degrees(math.acos(min(airframe.hover_fraction / THRUST_LEFT, 1.0)))
    tilt_deg = min(float(rng.uniform(*TILT_DEG)), steepest_deg)
    climb, sink = float(rng.uniform(*CLIMB_M_S)), float(rng.uniform(*SINK_M_S))
    control = {"tilt_max_rad": math.radians(tilt_deg), "climb_max_m_s": climb, "descent_max_m_s": sink}
    parameters = {
        "MPC_MAN_TILT_MAX": tilt_deg,
        "MPC_MAN_Y_MAX": float(rng.uniform(*YAW_DEG_S)),
        "MPC_VEL_MANUAL": float(rng.uniform(*SPEED_M_S)),
        "MPC_ACC_HOR": float(rng.uniform(*ACCELERATION_M_S2)),
        "MPC_JERK_MAX": float(rng.uniform(*JERK_M_S3)),
        "MPC_ACC_UP_MAX": 10.0,
        "MPC_ACC_DOWN_MAX": 10.0,
    }
    data = airframe.model_dump()
    data["control"] |= control
    if rng.random() < FILTER_SHARE:
        # Aided by motion capture: optical flow does not see such flights.
        data["estimate"]["kind"] = "ekf"
        for sensor, is_fitted in (("optical_flow", False), ("range_finder", False), ("motion_capture", True)):
            data["sensors"][sensor]["fitted"] = is_fitted
    return Airframe.model_validate(data), parameters


# --- the table


def text_of(rows: Sequence[Row]) -> str:
    """By IMU rate, mode and air what was reported in the air, then every report. The bar: 0."""
    frame = pd.DataFrame(rows).assign(false=[_in_the_air(row) for row in rows])
    lines = by_each(frame[frame["watched_s"] > 0.0], ("imu_hz", "mode", "air"), _figures)
    touched = frame[frame["touched"]]["seed"].nunique()
    lines += f"{touched} flights touched the ground; reports from then on do not count. Bar: 0 reported.\n"
    for row in frame.explode("false").dropna(subset="false").to_dict("records"):
        where = f"seed {row['seed']}, {row['imu_hz']} Hz, {row['mode']}, {row['air']}"
        lines += f"{where}: {row['false']}\n"
    return lines


def _figures(flights: pd.DataFrame) -> Row:
    kinds = Counter(one["kind"] for false in flights["false"] for one in false)
    hours, tilts = flights["watched_s"].sum() / 3600.0, [tilts[:2] for tilts in flights["tilt_deg"] if tilts]
    return {
        "flights": len(flights),
        "watched, h": f"{hours:.2f}",
        "reported": kinds.total(),
        "an hour, at most": f"{at_most_an_hour(kinds.total(), hours):.2f}",
        "tilt, median, 90 %": "/".join(f"{value:.0f}" for value in np.median(tilts, axis=0)) if tilts else "-",
        "as": ", ".join(f"{kind} {number}" for kind, number in kinds.most_common()),
    }


def _in_the_air(row: Row) -> list[Row]:
    return [one for one in row["reported"] if one["in_the_air"]]
