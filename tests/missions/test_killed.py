"""The companion gone in the middle of a recovery: the vehicle comes down by itself, and does not run into anything."""

import numpy as np
import pytest

from companion.companion import Companion
from sim_vehicle.vehicle import SimulatedVehicle
from tests.missions.test_missions import load

EPOCH_US = 1_600_000_000_000_000
INTERVALS_A_SECOND = 250


@pytest.mark.parametrize("kept_s", [0.02, 0.3, 1.0])
def test_a_vehicle_whose_companion_is_killed_while_it_recovers_fails_safe(kept_s):
    # Given wall.yaml, killed so long after the hit; the recovery setpoint has reached the vehicle
    mission, world = load("wall")
    companion, vehicle = Companion(mission), SimulatedVehicle(world.airframe, world.scene, world.seed)
    companion.confirm_plan()
    pending, hit_at_us = b"", None
    while hit_at_us is None or vehicle.time_boot_us < hit_at_us + kept_s * 1e6:
        frames = vehicle.step(pending)
        result = companion.step(b"".join(frames), EPOCH_US + vehicle.time_boot_us)
        pending = b"".join(result.sent_frames)
        if any(event.kind == "detection" for event in result.events):
            hit_at_us = vehicle.time_boot_us
    # When nothing comes any more
    killed_at_us = vehicle.time_boot_us
    for _ in range(12 * INTERVALS_A_SECOND):
        vehicle.step(b"")
    # Then it has landed within seconds, softly, near where it recovered, without another hit
    series = vehicle.truth.series()
    after = series["time_boot_us"] >= killed_at_us
    position, velocity = series["position_ned_m"][after], series["velocity_ned_m_s"][after]
    touchdown = np.argmax(position[:, 2] > -0.15)
    assert touchdown > 0
    assert velocity[: touchdown + 1, 2].max() < 1.2
    assert np.hypot(*(position[-1, :2] - [2.8, 0.0])) < 1.0
    assert len(vehicle.truth.hits) == 1
