"""The bench's healthy flights: what is flown."""

import math

import numpy as np

from bench.cases.mishaps import FlightCase
from bench.fly import cruise
from bench.fly.cruise import fly_healthy
from companion.messages import LandedState
from sim_vehicle.airframe import load_built_in


def test_a_healthy_flight_goes_from_the_ground_to_the_ground_and_is_hard(monkeypatch):
    # Given a pilot with half a minute in the air
    monkeypatch.setattr(cruise, "AIRBORNE_S", 30.0)
    flown = fly_healthy(FlightCase("calm", 0, "foldable", ()), load_built_in("foldable"))
    samples, situations = flown.recording.samples, flown.recording.situations
    phases = np.array(flown.phases)
    # Then it begins and ends on the ground, motors off at the end, after a landing that was felt
    assert (phases[0], phases[-1]) == ("ground", "landed")
    assert situations[-1].landed_state is LandedState.ON_GROUND and situations[-1].armed is False
    assert abs(samples[-1].position_ned_m[2] - samples[0].position_ned_m[2]) < 0.1
    felt = [math.hypot(*s.specific_force_frd_m_s2) for s, p in zip(samples, phases, strict=True) if p == "landing"]
    assert max(felt) > 18.0
    # And only in take-off and on the ground nothing is to be reported
    off = {phase for phase, now in zip(phases, situations, strict=True) if now.off_reason is not None}
    assert off == {"ground", "takeoff"}
    # And no obstacle was ever touched
    assert not any(flown.recording.contact_m_s2)


def test_a_flip_goes_all_the_way_round_and_is_caught(monkeypatch):
    # Given a pilot who knows nothing but flips
    for manoeuvre in ("_dash", "_jump", "_stop", "_slalom", "_spin", "_hover"):
        monkeypatch.setattr(cruise.Pilot, manoeuvre, cruise.Pilot._flip)
    monkeypatch.setattr(cruise, "AIRBORNE_S", 4.0)
    flown = fly_healthy(FlightCase("calm", 3, "rigid", ()), load_built_in("rigid"))
    # Then the vehicle was upside down on the way, and upright soon after
    upright = [1 - 2 * (s.attitude_wxyz[1] ** 2 + s.attitude_wxyz[2] ** 2) for s in flown.recording.samples]
    phases = flown.phases
    flipped = [u for u, phase in zip(upright, phases, strict=True) if phase == "flip"]
    assert min(flipped) < -0.95
    assert upright[len(phases) - 1 - phases[::-1].index("caught")] > 0.95
