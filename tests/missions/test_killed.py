"""The companion gone in the middle of a recovery: the vehicle comes down by itself, and does not run into anything."""

import numpy as np
import pytest

from companion.companion import Companion
from rebound_cli.inputs import mission_from, world_from
from sim_vehicle.vehicle import SimulatedVehicle
from tests.missions.test_missions import FOLDER, load_document

pytestmark = pytest.mark.flight

EPOCH_US = 1_600_000_000_000_000
INTERVALS_A_SECOND = 250


def killed_after(document, kept_s):
    """The vehicle, flown on for 12 s after the companion was killed so long after the hit; and when that was."""
    world = world_from(document)
    companion = Companion(mission_from(document, world))
    vehicle = SimulatedVehicle(world.airframe, world.scene, world.seed)
    companion.confirm_plan()
    pending, hit_at_us = b"", None
    while hit_at_us is None or vehicle.time_boot_us < hit_at_us + kept_s * 1e6:
        frames = vehicle.step(pending)
        result = companion.step(b"".join(frames), EPOCH_US + vehicle.time_boot_us)
        pending = b"".join(result.sent_frames)
        if any(event.kind == "detection" for event in result.events):
            hit_at_us = vehicle.time_boot_us
    killed_at_us = vehicle.time_boot_us
    for _ in range(12 * INTERVALS_A_SECOND):
        vehicle.step(b"")
    series = vehicle.truth.series()
    after = series["time_boot_us"] >= killed_at_us
    return vehicle, series["position_ned_m"][after], series["velocity_ned_m_s"][after]


@pytest.mark.parametrize("kept_s", [0.02, 0.3, 1.0])
def test_a_vehicle_whose_companion_is_killed_while_it_recovers_fails_safe(kept_s):
    # When wall.yaml is killed so long after the hit; the recovery setpoint has reached the vehicle
    vehicle, position, velocity = killed_after(load_document(FOLDER / "wall.yaml"), kept_s)
    # Then it has landed within seconds, softly, near where it recovered, without another hit
    touchdown = np.argmax(position[:, 2] > -0.15)
    assert touchdown > 0
    assert velocity[: touchdown + 1, 2].max() < 1.2
    assert np.hypot(*(position[-1, :2] - [2.8, 0.0])) < 1.0
    assert len(vehicle.truth.hits) == 1


@pytest.mark.parametrize("kept_s", [0.02, 0.08, 0.2])
def test_a_brake_of_a_throw_that_nobody_ends_makes_no_fall(kept_s):
    # Given a hit at 5 m/s that throws the vehicle up, braked by up to 8 m/s^2 downwards
    document = load_document(FOLDER / "wall.yaml")
    document.data["items"][1]["go_to"] |= {"speed_m_s": 5.0, "acceleration_m_s2": 4.0}
    document.data |= {"companion": {"flight": {"speeding_up_m_s2": 4.0}}}
    # When that is the last that comes, and PX4 waits for COM_OF_LOSS_T, 1 s
    _, _, velocity = killed_after(document, kept_s)
    # Then its velocity loop ends it at 8 m/s^2 over MPC_Z_VEL_P_ACC, 4 1/s, and what it sank with; not at 5 m/s
    assert velocity[:, 2].max() < 2.8
