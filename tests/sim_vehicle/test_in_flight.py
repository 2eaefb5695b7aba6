"""A vehicle that begins in flight is one that has been flying for a while."""

import math

import pytest

from bench.cases.vehicles import vehicle_of
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle

START_NED_M = (2.0, -3.0, -20.0)


@pytest.mark.parametrize("wind", [(0.0, 0.0, 0.0), (0.0, 3.0, 0.0)])
@pytest.mark.parametrize("speed_m_s", [0.5, 5.0])
@pytest.mark.parametrize(("kind", "seed"), [("foldable", None), ("rigid", 7)])
def test_a_vehicle_that_begins_in_flight_goes_steadily_on(kind, seed, speed_m_s, wind):
    # Given a vehicle that begins on its way north-east, perhaps in a wind from the west
    velocity = (speed_m_s * 0.6, speed_m_s * 0.8, 0.0)
    vehicle = SimulatedVehicle(vehicle_of(kind, seed).airframe, Scene(wind_ned_m_s=wind), 3)
    vehicle.begin_in_flight(START_NED_M, velocity)
    # When it flies for two seconds
    began_us = vehicle.time_boot_us
    vehicle.step(b"")
    texts = list(vehicle.texts)
    while vehicle.time_boot_us < began_us + 2_000_000:
        vehicle.step(b"")
        texts += vehicle.texts
    # Then it has gone straight on as fast, level and nose ahead, and nothing was told: no arming, no take-off
    body = vehicle.state.body
    flown_s = 1e-6 * vehicle.time_boot_us - 0.004
    expected = [at + flown_s * v for at, v in zip(START_NED_M, velocity, strict=True)]
    assert body[0:3] == pytest.approx(expected, abs=0.25)
    path = vehicle.truth.series()["velocity_ned_m_s"][1:]
    assert abs(path - velocity).max() < 0.3
    w, _, _, z = body[6:10]
    assert 2.0 * math.atan2(z, w) == pytest.approx(math.atan2(0.8, 0.6), abs=0.1)
    assert texts == []
