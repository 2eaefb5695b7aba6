"""Flights that never were: what the companion told and what really happened, put together by hand."""

import numpy as np

from bench.fly.lockstep import JudgedFlight
from companion.mission.model import Mission
from companion.reflex.recovery.collision import CollisionReport
from companion.report import Event, FlightReport
from rebound_cli.results.truth_match import FlightTruth
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit

EPOCH_US = 1_000_000_000
STANDING_M = 0.08
# Seconds: armed, up, there, told to land, stands.
ARMED_S, UP_S, THERE_S, LANDING_S, DONE_S = 5.0, 8.0, 12.0, 12.1, 17.0


def mission(**changes):
    """Up 2 m, 4 m north, down."""
    data = {
        "name": "made-up",
        "items": [{"takeoff": {"height_m": 2}}, {"go_to": {"position_ned_m": [4, 0, -2]}}, {"land": {}}],
        **changes,
    }
    return Mission.model_validate(data)


def event(at_s, kind, **data):
    return Event(EPOCH_US + round(at_s * 1e6), kind, kind, data)


def plain_events():
    return [
        event(ARMED_S, "armed"),
        event(UP_S, "item", step=1),
        event(THERE_S, "item", step=2),
        event(LANDING_S, "landing"),
        event(DONE_S, "done"),
    ]


def events_with_hit(*after, hit_s=10.0):
    """The same with a hit on the way; `after` is what the companion did then."""
    return [*plain_events()[:2], event(hit_s + 0.004, "detection"), event(hit_s + 2.0, "recovered"), *after]


def path(*points, step_s=0.02):
    """Rows of truth on straight lines between (seconds, north, east, height of the feet)."""
    times, north, east, height = (np.array(column, float) for column in zip(*points, strict=True))
    seconds = np.arange(0.0, times[-1] + step_s / 2, step_s)
    n, e, h = (np.interp(seconds, times, column) for column in (north, east, height))
    place = np.column_stack([n, e, -h - STANDING_M])
    level = np.tile([1.0, 0.0, 0.0, 0.0], (len(seconds), 1))
    velocity = np.gradient(place, step_s, axis=0)
    return {
        "time_boot_us": seconds * 1e6,
        "position_ned_m": place,
        "velocity_ned_m_s": velocity,
        "attitude_wxyz": level,
    }


def plain_path():
    return path(
        (0, 0, 0, 0), (ARMED_S, 0, 0, 0), (UP_S, 0, 0, 2), (THERE_S, 4, 0, 2), (15.5, 4, 0, 0), (DONE_S, 4, 0, 0)
    )


def hit(at_s=10.0, speed_m_s=2.0, obstacle="wall", normal=(-1.0, 0.0, 0.0), place=(2.0, 0.0, -2.08)):
    velocity = tuple(-speed_m_s * part for part in normal)
    return Hit(
        obstacle=obstacle,
        contact_at_boot_us=at_s * 1e6,
        ended_at_boot_us=at_s * 1e6 + 30_000,
        contact_position_ned_m=place,
        impact_velocity_ned_m_s=velocity,
        normal_ned=normal,
        max_fold_m=0.02,
        peak_force_n=100.0,
        rebound_velocity_ned_m_s=(0.0, 0.0, 0.0),
        impulse_ned_n_s=(0.0, 0.0, 0.0),
        energy_before_j=1.0,
        energy_after_j=0.1,
        kind="wall",
    )


def collision(at_s=10.004, setpoint=(1.5, 0.0, -2.08), settled_s=1.0):
    return CollisionReport(
        detected_at_us=EPOCH_US + round(at_s * 1e6),
        sample_time_boot_us=round(at_s * 1e6),
        detector="fused",
        position_ned_m=(2.0, 0.0, -2.0),
        impact_velocity_ned_m_s=(2.0, 0.0, 0.0),
        impact_speed_m_s=2.0,
        normal_ned=(-1.0, 0.0, 0.0),
        peak_specific_force_m_s2=50.0,
        recovery_setpoint_ned_m=setpoint,
        settled_after_s=settled_s,
        overshoot_m=0.0,
        rebound_speed_m_s=0.4,
    )


def report(*collisions, outcome="completed"):
    return FlightReport(
        outcome=outcome,
        reason="landed and disarmed",
        autopilot="PX4",
        stream_rates_hz={},
        collisions=collisions,
        origin_ned_m=(0.0, 0.0, -STANDING_M),
        started_at_us=EPOCH_US,
        ended_at_us=EPOCH_US + round(DONE_S * 1e6),
        armed_at_us=EPOCH_US + round(ARMED_S * 1e6),
    )


def flight(events=None, series=None, hits=(), collisions=(), outcome="completed", **mission_changes):
    told = report(*collisions, outcome=outcome)
    truth = FlightTruth(tuple(hits), series or plain_path(), EPOCH_US)
    events = tuple(plain_events() if events is None else events)
    return JudgedFlight(mission(**mission_changes), told, events, truth, room(), load_built_in("foldable"))


def room(place=(2.2, 0.0, -2.0), normal=(-1.0, 0.0, 0.0)):
    """A wall across the way, or elsewhere."""
    wall = {"name": "wall", "point_ned_m": place, "normal_ned": normal, "width_m": 10.0, "height_m": 10.0}
    return Scene.model_validate({"walls": [wall]})
