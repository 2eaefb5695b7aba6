"""A vehicle under test, flown in lockstep: faults, obstacles and plates at run time, and the truth of it."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_vehicle.airframe import load_built_in
from sim_vehicle.errors import AirframeError, FaultError, ParameterError, SceneError
from sim_vehicle.scene import Scene
from sim_vehicle.shell.truth_file import load_clock
from sim_vehicle.testing import FaultRequest, LockstepVehicle, Motion, Pole, Wall, faults, save_truth
from sim_vehicle.vehicle import SimulatedVehicle
from tests.sim_vehicle.vehicle_client import ARM_DISARM, TAKEOFF, End


class Pilot(End):
    """Commands out, messages in; each message with the vehicle's time at which it came."""

    def __init__(self, vehicle: LockstepVehicle) -> None:
        super().__init__(vehicle.send)
        self.vehicle = vehicle

    def fly(self, seconds: float) -> None:
        until_s = self.vehicle.time_s + seconds
        while self.vehicle.time_s < until_s - 1e-9:
            self.hear([self.vehicle.advance(0.0)], self.vehicle.time_s)

    def take_off(self) -> None:
        """To 2.5 m, where it holds."""
        self.command(ARM_DISARM, 1, 0)
        self.command(TAKEOFF)
        self.vehicle.advance_until(lambda truth: truth.mode == "Hold" and truth.height_m > 2, 20)
        self.fly(1.0)
        self.forget()


def hovering(**setup: Any) -> Pilot:
    pilot = Pilot(LockstepVehicle(**setup))
    pilot.take_off()
    return pilot


def standing(**setup: Any) -> Pilot:
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


def test_a_clock_jumps_and_jumps_back(tmp_path: Path) -> None:
    pilot = standing()
    pilot.fly(0.5)
    pilot.vehicle.inject(faults.clock_jump(100.0), for_s=0.5)
    pilot.fly(1.0)
    jumps = np.diff([message.time_usec for message in pilot.all("HIGHRES_IMU")]) / 1e6
    assert jumps.max() == pytest.approx(100.0, abs=0.03) and jumps.min() == pytest.approx(-100.0, abs=0.03)
    save_truth(tmp_path / "truth.npz", pilot.vehicle.recorded, 0)
    assert [later_us for _, later_us in load_clock(tmp_path / "truth.npz")[1]] == [100_000_000, -100_000_000]


def test_a_lost_gps_has_no_fix_and_the_estimate_goes_astray_until_it_is_back() -> None:
    pilot = hovering()
    loss = pilot.vehicle.inject(faults.gps_loss(drift_m_s2=0.5))
    pilot.fly(4.0)
    assert pilot.all("GPS_RAW_INT")[-1].fix_type == 0
    assert not pilot.all("SYS_STATUS")[-1].onboard_control_sensors_health & 0x20
    assert astray_m(pilot) > 0.2
    loss.remove()
    pilot.fly(1.0)
    assert pilot.all("GPS_RAW_INT")[-1].fix_type == 3
    assert astray_m(pilot) < 0.1
    # And it has none where a client injects the failure
    pilot.command(420, 4, 1, 0)
    pilot.fly(1.0)
    assert pilot.all("GPS_RAW_INT")[-1].fix_type == 0


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
        (faults.sensor_dropout("baro"), None, "baro_dropout"),  # type: ignore[arg-type]
    ],
)
def test_what_cannot_be_injected_is_one_sentence(request_: FaultRequest, for_s: float | None, words: str) -> None:
    vehicle = LockstepVehicle()
    with pytest.raises(FaultError, match=words):
        vehicle.inject(request_, for_s=for_s)
    vehicle.advance(0.1)
    assert vehicle.truth.faults == ()


def test_a_vehicle_that_is_not_changed_is_the_one_of_a_mission_file() -> None:
    plain = SimulatedVehicle(load_built_in("foldable"), Scene(), 5)
    sent = b"".join(packet for _ in range(250) for packet in plain.step(b""))
    vehicle = LockstepVehicle(seed=5)
    assert vehicle.advance(1.0) == sent


HOVER_M = 2.5


def pushed_north(pilot: Pilot) -> None:
    """Shove the vehicle away at more than 2 m/s."""
    pilot.vehicle.inject(faults.other("push", force_ned_n=(9, 0, 0), rise_s=0.0), for_s=0.3)


def test_a_second_obstacle_during_a_contact_leaves_the_contact_what_it_is() -> None:
    """The pole's row in the world moves on when a wall comes before it."""

    def hit(places_more: bool) -> Any:
        pilot = hovering(obstacles=[Pole(point_ned_m=(0.6, 0.0, 0), name="mast")])
        pushed_north(pilot)
        pilot.vehicle.advance_until(lambda truth: max(truth.arm_fold_m) > 0.003, 3.0)
        if places_more:
            pilot.vehicle.place(Wall(point_ned_m=(-5, 0, 0), normal_ned=(1, 0, 0), name="far"))
        pilot.vehicle.advance_until(lambda truth: truth.hits, 1.0)
        return pilot.vehicle.truth.hits[0]

    assert hit(True) == hit(False)


def test_an_obstacle_removed_during_a_contact_ends_it() -> None:
    pilot = hovering()
    wall = pilot.vehicle.place(Wall(point_ned_m=(0.6, 0, -HOVER_M), normal_ned=(-1, 0, 0)))
    pushed_north(pilot)
    pilot.vehicle.advance_until(lambda truth: max(truth.arm_fold_m) > 0.003, 3.0)
    wall.remove()
    (hit,) = pilot.vehicle.truth.hits
    assert hit.obstacle == "wall 1"
    # Arms fold by 3 cm at most: with the wall there it would not get so far
    beyond_m = hit.contact_position_ned_m[0] + 0.06
    pilot.vehicle.advance_until(lambda truth: truth.position_ned_m[0] > beyond_m, 1.0)


def test_a_motion_counts_from_the_moment_of_placing() -> None:
    pilot = hovering()
    pilot.vehicle.place(
        Wall(
            point_ned_m=(1.2, 0, -HOVER_M),
            normal_ned=(-1, 0, 0),
            motion=Motion(velocity_ned_m_s=(-1.0, 0, 0), from_s=0.5, until_s=1.6),
        )
    )
    placed_s = pilot.vehicle.time_s
    pilot.vehicle.advance_until(lambda truth: truth.hits, 4.0)
    (hit,) = pilot.vehicle.truth.hits
    assert hit.surface_velocity_ned_m_s == pytest.approx((-1, 0, 0), abs=1e-6)
    assert hit.contact_at_boot_us / 1e6 - placed_s == pytest.approx(0.5 + 1.2 - 0.1825, abs=0.1)


@pytest.mark.parametrize("bearing_deg", [0.0, 90.0, 180.0, -45.0])
@pytest.mark.parametrize("airframe", ["foldable", "rigid"])
def test_a_strike_comes_from_where_and_as_fast_as_asked(airframe: str, bearing_deg: float) -> None:
    pilot = hovering(airframe=airframe, yaw_deg=30.0)
    begun_s = pilot.vehicle.time_s
    name = pilot.vehicle.hit(1.5, bearing_deg=bearing_deg)
    pilot.fly(1.0)
    (hit,) = pilot.vehicle.truth.hits
    assert hit.obstacle == name == "strike 1"
    heading = math.radians(30.0 + bearing_deg)
    assert hit.normal_ned == pytest.approx((-math.cos(heading), -math.sin(heading), 0), abs=0.03)
    assert hit.closing_speed_m_s == pytest.approx(1.5, abs=0.05)
    assert hit.contact_at_boot_us / 1e6 - begun_s == pytest.approx(0.02, abs=0.01)
    # Kicked away from where the plate came from, and nothing is left of that plate
    assert np.dot(hit.rebound_velocity_ned_m_s, hit.normal_ned) > 1.5
    pilot.fly(2.0)
    assert len(pilot.vehicle.truth.hits) == 1
    # A rigid frame hands on more than the accelerometer can show
    assert airframe == "foldable" or pilot.all("VIBRATION")[-1].clipping_0 > 0


def test_the_truth_is_neither_late_nor_noisy() -> None:
    """A standing vehicle's estimate wanders; the truth does not."""
    pilot = Pilot(LockstepVehicle(yaw_deg=90.0))
    pilot.fly(1.0)
    truth = pilot.vehicle.truth
    assert truth.time_boot_s == pilot.vehicle.time_s
    assert truth.position_ned_m[:2] == pytest.approx((0, 0), abs=1e-6) and truth.speed_m_s < 1e-6
    assert truth.attitude_wxyz == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)), abs=1e-6)
    assert not truth.is_armed and truth.mode == "Hold" and truth.height_m == pytest.approx(0.08, abs=0.01)
    path = pilot.vehicle.recorded.series()
    assert path["time_boot_us"][-1] == round(1e6 * truth.time_boot_s)


def test_bad_setups_are_one_sentence() -> None:
    with pytest.raises(ParameterError, match="no parameter 'MPC_XY_CRUSE'"):
        LockstepVehicle(parameters={"MPC_XY_CRUSE": 3})
    with pytest.raises(ParameterError, match="COM_OBL_RC_ACT cannot be inf"):
        LockstepVehicle(parameters={"COM_OBL_RC_ACT": math.inf})
    with pytest.raises(SceneError, match=r"faults\.0\.motor_failure"):
        LockstepVehicle(faults=[{"kind": "motor_failure", "at_s": 1, "motor": 9}])
    with pytest.raises(SceneError, match="obstacles are each a Wall, a Pole or a Box"):
        LockstepVehicle(obstacles=[{"point_ned_m": (2, 0, 0), "normal_ned": (-1, 0, 0)}])
    with pytest.raises(SceneError, match="up to 800 m/s, not 1000 m/s"):
        LockstepVehicle().hit(1000.0)


def test_an_airframe_of_ones_own_comes_from_its_file_and_time_goes_on_alone(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("based_on: rigid\nmass_kg: 1.05\n")
    vehicle = LockstepVehicle(airframe=str(file))
    assert vehicle.setup.airframe_loaded().mass_kg == 1.05
    for backwards in (-1.0, math.nan):
        with pytest.raises(ValueError, match="time advances by seconds"):
            vehicle.advance(backwards)
    for text, words in (("mass_kg: [", "cannot be read"), ("based_on: rigid\nmass_kg: 0", "mass_kg: ")):
        file.write_text(text)
        with pytest.raises(AirframeError, match=words):
            LockstepVehicle(airframe=str(file))
