"""Every fault that can be injected while the vehicle flies: it acts from now on, for a while, and can be taken back."""

import math
from typing import Any

import numpy as np
import pytest

from sim_vehicle.airframe import load_built_in
from sim_vehicle.errors import FaultError
from sim_vehicle.testing import FaultRequest, LockstepVehicle, faults
from tests.sim_vehicle.bench.pilot import Pilot, hovering


def standing(**setup: Any) -> Pilot:
    """On the ground, a second after boot."""
    pilot = Pilot(LockstepVehicle(**setup))
    pilot.fly(1.0)
    pilot.forget()
    return pilot


def test_what_is_removed_early_ends_early_and_only_once() -> None:
    pilot = standing()
    dropout = pilot.vehicle.inject(faults.sensor_dropout(), for_s=10.0)
    pilot.fly(0.3)
    dropout.remove()
    dropout.remove()
    pilot.fly(0.2)
    assert pilot.times("HIGHRES_IMU")[0] == pytest.approx(1.3, abs=0.03)
    # And nothing else drops out
    assert pilot.times("ATTITUDE")[0] < 1.03
    (span,) = pilot.vehicle.truth.faults
    assert (span.began_at_boot_us, span.ended_at_boot_us) == (1_004_000, 1_304_000)


def test_a_link_that_is_cut_carries_nothing_either_way() -> None:
    pilot = standing()
    cut = pilot.vehicle.inject(faults.link_cut())
    pilot.command(400, 1, 0)
    pilot.fly(1.0)
    assert not pilot.received and not pilot.vehicle.truth.is_armed
    cut.remove()
    pilot.command(400, 1, 0)
    pilot.fly(0.1)
    assert pilot.received and pilot.vehicle.truth.is_armed


def stamps(pilot: Pilot) -> np.ndarray:
    return np.array([message.time_usec for message in pilot.all("HIGHRES_IMU")])


def test_a_clock_jumps_and_jumps_back() -> None:
    pilot = standing()
    pilot.fly(0.5)
    pilot.vehicle.inject(faults.clock_jump(100.0), for_s=0.5)
    pilot.fly(1.0)
    jumps = np.diff(stamps(pilot)) / 1e6
    assert jumps.max() == pytest.approx(100.0, abs=0.03) and jumps.min() == pytest.approx(-100.0, abs=0.03)


def test_a_lost_gps_has_no_fix_and_the_estimate_goes_astray_until_it_is_back() -> None:
    pilot = hovering()
    loss = pilot.vehicle.inject(faults.gps_loss(drift_m_s2=0.5))
    pilot.fly(4.0)
    assert pilot.all("GPS_RAW_INT")[-1].fix_type < 3
    assert astray_m(pilot) > 0.2
    loss.remove()
    pilot.fly(1.0)
    assert pilot.all("GPS_RAW_INT")[-1].fix_type >= 3
    assert astray_m(pilot) < 0.1


def astray_m(pilot: Pilot) -> float:
    message, truth = pilot.all("LOCAL_POSITION_NED")[-1], pilot.vehicle.truth
    return math.dist((message.x, message.y), truth.position_ned_m[:2])


def test_an_estimate_is_reset_and_says_so() -> None:
    pilot = standing()
    pilot.fly(0.2)
    before = pilot.all("ODOMETRY")[-1]
    reset = pilot.vehicle.inject(faults.ekf_reset(position_jump_ned_m=(1.0, 0.0, 0.0)))
    pilot.fly(0.5)
    after = pilot.all("ODOMETRY")[-1]
    assert after.reset_counter == before.reset_counter + 1
    assert after.x - before.x == pytest.approx(1.0, abs=0.1)
    reset.remove()
    pilot.fly(0.5)
    back = pilot.all("ODOMETRY")[-1]
    assert back.reset_counter == before.reset_counter + 2
    assert back.x == pytest.approx(before.x, abs=0.1)


@pytest.mark.parametrize(
    ("request_", "for_s", "words"),
    [
        (faults.packet_loss(2.0), None, "wire, loss: Input should be less than or equal to 1"),
        (faults.motor_failure(7), None, "motor_failure: no motor 7; this vehicle's are 0 to 3."),
        (faults.packet_loss(0.1, messages=("HIGHRES",)), None, "no MAVLink message is called 'HIGHRES'"),
        (faults.other("gust", velocity_ned_m_s=(1, 0, 0)), None, "gust has to end"),
        (faults.other("payload_drop", mass_kg=0.1), 2.0, "payload_drop cannot be undone"),
        (faults.link_cut(), 0.0, "for_s must be more than 0"),
        (faults.other("gremlins"), None, "gremlins"),
    ],
)
def test_what_cannot_be_injected_is_one_sentence(request_: FaultRequest, for_s: float | None, words: str) -> None:
    vehicle = LockstepVehicle()
    with pytest.raises(FaultError, match=words):
        vehicle.inject(request_, for_s=for_s)
    vehicle.advance(0.1)
    assert vehicle.truth.faults == ()


def test_a_vehicle_that_is_not_changed_is_the_one_of_a_mission_file() -> None:
    from sim_vehicle.scene import Scene
    from sim_vehicle.vehicle import SimulatedVehicle

    plain = SimulatedVehicle(load_built_in("foldable"), Scene(), 5)
    sent = b"".join(packet for _ in range(250) for packet in plain.step(b""))
    vehicle = LockstepVehicle(seed=5)
    assert vehicle.advance(1.0) == sent
