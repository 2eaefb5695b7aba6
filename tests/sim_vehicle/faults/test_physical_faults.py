"""Each fault does to the vehicle, or to its wire, what its figures say, when it says, and nothing before or after."""

import math
import random
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.faults.spec import WireFault
from sim_vehicle.faults.wind import Dryden, strengths_and_lengths
from sim_vehicle.faults.wire import Wire, split
from sim_vehicle.mavlink.faulty_link import restamped
from sim_vehicle.physics.imu import shake
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from tests.sim_vehicle.physics.throwing import flown, quiet, released
from tests.sim_vehicle.vehicle_client import Client

FOLDABLE = load_built_in("foldable")
QUIET = quiet(FOLDABLE)
HOVER = (0.0, 0.0, -20.0)
STAY = TrajectorySetpoint(HOVER, (0.0, 0.0, 0.0), yaw_rad=0.0)


def hover(*faults: dict[str, Any], airframe: Airframe = QUIET, seed: int = 1) -> Plant:
    plant = Plant(airframe, Scene.model_validate({"faults": faults}), seed)
    plant.cruise(HOVER, (0.0, 0.0, 0.0), 0.0)
    return plant


def velocity(plant: Plant) -> np.ndarray:
    return np.array(plant.state.body[3:6])


def test_a_gust_pushes_by_the_drag_of_its_air() -> None:
    """Without control: m dv = c V (length - rise), as long as the vehicle is slow against the gust."""
    airframe = quiet(FOLDABLE, drag_n_s_m=0.05)
    gust = {"kind": "gust", "between_s": [0.1, 0.5], "velocity_ned_m_s": [0, 6, 0], "rise_s": 0.1}
    plant = released(airframe, 0.6, faults=[gust])
    assert plant.state.body[4] == pytest.approx(0.05 * 6 * 0.3 / airframe.mass_kg, rel=0.02)
    assert plant.disturbance.wind_ned_m_s == pytest.approx([0, 0, 0])


def test_turbulence_has_the_strength_and_the_memory_that_the_model_asks_for() -> None:
    level_m_s, vertical_m_s, level_m, vertical_m = strengths_and_lengths(6.1, 15.4)
    assert vertical_m_s == pytest.approx(1.54) and vertical_m == pytest.approx(6.1)
    # 20 ft: 0.177 + 0.01646 = 0.19346, to the power of 0.4 0.518, of 1.2 0.1393
    assert level_m_s == pytest.approx(1.54 / 0.518, rel=0.01)
    assert level_m == pytest.approx(6.1 / 0.1393, rel=0.01)
    dryden = Dryden(15.4, (1.0, 0.0, 0.0), 0.02, np.random.default_rng(5))
    air = np.array([dryden.next(6.1, 15.0) for _ in range(150_000)])
    assert air.std(axis=0) == pytest.approx([level_m_s, level_m_s, vertical_m_s], rel=0.06)
    # Along the wind a first-order process: after L / V its correlation is 1 / e.
    lag = round(level_m / 15.0 / 0.02)
    assert np.corrcoef(air[:-lag, 0], air[lag:, 0])[0, 1] == pytest.approx(math.exp(-1), abs=0.08)


@pytest.mark.parametrize(("motor", "roll", "pitch"), [(0, 1, -1), (1, -1, 1), (2, -1, -1), (3, 1, 1)])
def test_a_dead_motor_lets_its_corner_fall(motor: int, roll: int, pitch: int) -> None:
    """Front right gone: the right side and the nose go down, roll positive, pitch negative."""
    plant = hover({"kind": "motor_failure", "motor": motor, "at_s": 0.1})
    flown(plant, STAY, 0.1)
    assert np.abs(plant.state.body[10:13]).max() < 1e-3
    flown(plant, STAY, 0.048)
    p, q = plant.state.body[10:12]
    assert math.copysign(1, p) == roll and math.copysign(1, q) == pitch
    assert abs(p) > 1.0 and abs(q) > 1.0


def test_free_fall_is_felt_as_nothing_at_all() -> None:
    plant = hover({"kind": "free_fall", "between_s": [0.2, 0.6]})
    outputs = flown(plant, STAY, 0.6)
    # Motors run down in 20 ms; then there is no specific force.
    assert np.abs([output.specific_force_frd_m_s2 for output in outputs[-50:]]).max() < 0.2
    assert velocity(plant)[2] == pytest.approx(9.81 * 0.38, rel=0.02)


def test_a_battery_that_sags_takes_thrust_with_the_square_of_its_voltage() -> None:
    plant = hover({"kind": "battery_sag", "between_s": [0.0, 2.0], "voltage_share": 0.9})
    flown(plant, STAY, 4.0)
    given = plant.state.motor_thrust_n[:4] / plant.state.motor_command_n[:4]
    assert given == pytest.approx([0.81] * 4, abs=0.005)
    # The control makes up for it with more throttle.
    assert float(np.sum(plant.state.motor_thrust_n[:4])) == pytest.approx(QUIET.mass_kg * 9.81, rel=0.01)


def test_a_payload_that_drops_lets_the_vehicle_jump_by_its_weight() -> None:
    plant = hover({"kind": "payload_drop", "at_s": 3.0, "mass_kg": 0.1})
    before = flown(plant, STAY, 3.0)[-1].specific_force_frd_m_s2[2]
    held_n = -before * (QUIET.mass_kg + 0.1)
    assert held_n == pytest.approx((QUIET.mass_kg + 0.1) * 9.81, rel=0.01)
    first = flown(plant, STAY, 0.004)[-1].specific_force_frd_m_s2[2]
    assert first == pytest.approx(-held_n / QUIET.mass_kg, rel=0.01)


def test_a_push_gives_its_impulse_and_no_moment_through_the_centre() -> None:
    push = {"kind": "push", "between_s": [0.1, 0.5], "force_ned_n": [2, 0, 0], "rise_s": 0.1}
    plant = released(QUIET, 0.8, faults=[push])
    assert plant.state.body[3] == pytest.approx(2 * 0.3 / QUIET.mass_kg, rel=0.01)
    assert np.abs(plant.state.body[10:13]).max() == 0.0


@pytest.mark.parametrize("motor", [None, 1])
def test_vibration_has_the_strength_that_was_asked_for_at_hover(motor: int | None) -> None:
    asked = {"kind": "vibration", "at_s": 0, "accelerometer_rms_m_s2": 20, "gyroscope_rms_rad_s": 0.5, "motor": motor}
    plant = hover(asked)
    # It shows in the samples, and in what their means leave of it
    assert np.ptp([sample.specific_force_frd_m_s2 for sample in flown(plant, STAY, 0.1)], axis=0).min() > 1.0
    # Four rotors that turn at nearly the same speed beat; their powers add up in the long run.
    spread = 0.05 if motor is not None else 0.75
    # And so it is on the six raw axes, looked at raw sample by raw sample
    shaken, rows = np.zeros(6), []
    for _ in range(8000):
        shake(plant.state, 125e-6, plant.constants, plant.disturbance, shaken)
        rows.append(shaken.copy())
    rms = np.sqrt((np.array(rows) ** 2).mean(axis=0))
    assert rms == pytest.approx([20, 20, 20, 0.5, 0.5, 0.5], rel=spread)


def test_a_bias_and_a_stuck_axis_show_in_the_mean_sample() -> None:
    plant = hover(
        {"kind": "imu_bias", "between_s": [0.1, 0.2], "accelerometer_frd_m_s2": [0.5, 0, 0],
         "gyroscope_frd_rad_s": [0, 0, 0.1]},
        {"kind": "imu_stuck", "at_s": 0.3, "axis": "accelerometer_z"},
        {"kind": "imu_stuck", "at_s": 0.3, "axis": "gyroscope_y", "value": 2.0},
        {"kind": "free_fall", "at_s": 0.3},
    )  # fmt: skip
    outputs = flown(plant, STAY, 0.5)
    forces = np.array([output.specific_force_frd_m_s2 for output in outputs])
    rates = np.array([output.angular_velocity_frd_rad_s for output in outputs])
    assert forces[26:48, 0] == pytest.approx(0.5, abs=0.01) and forces[:24, 0] == pytest.approx(0.0, abs=0.01)
    assert rates[26:48, 2] == pytest.approx(0.1, abs=0.01)
    assert forces[76:, 2] == pytest.approx(forces[74, 2], abs=1e-9)
    assert rates[76:, 1] == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize(("name", "disturbed"), [("rigid", True), ("foldable", False)])
def test_after_a_clipped_hit_the_estimated_velocity_is_wrong_and_resets(name: str, disturbed: bool) -> None:
    """The rigid vehicle's hit at 2 m/s hides most of its 3.8 m/s from the sensor; the foldable's at 1 m/s nothing."""
    scene = Scene.model_validate(
        {"walls": [{"point_ned_m": [1, 0, -20], "normal_ned": [-1, 0, 0]}],
         "faults": [{"kind": "estimator_after_clipping", "at_s": 0}]}
    )  # fmt: skip
    speed_m_s = 2.0 if disturbed else 1.0
    plant = Plant(quiet(load_built_in(name)), scene, 1)
    plant.cruise(HOVER, (speed_m_s, 0.0, 0.0), 0.0)
    ahead = TrajectorySetpoint((None, 0.0, HOVER[2]), (speed_m_s, 0.0, 0.0), yaw_rad=0.0)
    while not plant.truth.hits:
        plant.step(ahead, armed=True)
    errors = []
    for _ in range(12):
        output = plant.step(ahead, armed=True)
        errors.append(np.linalg.norm(np.array(output.velocity_ned_m_s) - velocity(plant)))
    assert output.reset_counter == (4 if disturbed else 0)
    assert bool(max(errors) > 0.2) is disturbed


def test_faults_repeat_for_a_seed_and_leave_the_rest_of_the_noise_alone() -> None:
    def path(*faults: dict[str, Any], seed: int = 3) -> np.ndarray:
        plant = hover(*faults, airframe=FOLDABLE, seed=seed)
        flown(plant, STAY, 0.5)
        return plant.truth.series()["position_ned_m"]

    turbulence = {"kind": "turbulence", "wind_20ft_m_s": 10, "at_s": 0.0}
    assert (path(turbulence) == path(turbulence)).all()
    assert (path(turbulence) != path(turbulence, seed=4)).any()
    assert (path({"kind": "imu_bias", "at_s": 0.1}) == path()).all()


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({"kind": "gust", "at_s": 1, "velocity_ned_m_s": [1, 0, 0]}, "give between_s"),
        ({"kind": "gust", "between_s": [1, 1.5], "velocity_ned_m_s": [1, 0, 0]}, "no room to rise"),
        ({"kind": "free_fall"}, "give at_s"),
        ({"kind": "payload_drop", "between_s": [1, 2], "mass_kg": 0.1}, "give at_s, the moment"),
        ({"kind": "free_fall", "at_s": 1, "between_s": [1, 2]}, "not both"),
        ({"kind": "push", "between_s": [2, 1], "force_ned_n": [1, 0, 0]}, "ends before it begins"),
        ({"kind": "motor_failure", "motor": 8, "at_s": 0}, "less than 8"),
        ({"kind": "wire", "at_s": 0}, "at least one of loss"),
    ],
)
def test_faults_that_make_no_sense_are_refused(fault: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        Scene.model_validate({"faults": [fault]})


def test_the_body_takes_one_push_at_once_and_its_rotors_turn_at_one_speed() -> None:
    push = {"kind": "push", "force_ned_n": [1, 0, 0]}
    slow, fast = ({"kind": "vibration", "accelerometer_rms_m_s2": 1, "motor_hz": turns} for turns in (90, 180))
    for one, other, words in ((push, push, "let one end"), (slow, fast, "the same motor_hz")):
        Scene.model_validate({"faults": [one | {"between_s": [2, 3]}, other | {"between_s": [1, 2]}]})
        with pytest.raises(ValidationError, match=words):
            Scene.model_validate({"faults": [one | {"between_s": [2, 3]}, other | {"between_s": [1, 2.1]}]})
    Scene.model_validate({"faults": [slow | {"at_s": 0, "motor": motor} for motor in (0, 1)]})


STEP_US = 4000


def frame(number: int) -> bytes:
    return bytes([0xFD, 2, 0, 0, number & 0xFF, 1, 1, 105, 0, 0]) + number.to_bytes(2, "little") + b"\0\0"


def number_in(raw: bytes) -> int:
    return int.from_bytes(raw[10:12], "little")


def carried(**fault: Any) -> list[tuple[int, bytes]]:
    """One frame every 4 ms; (time, frame) as they arrive."""
    wire = Wire([WireFault.model_validate({"kind": "wire", "at_s": 0, **fault})], 1)
    arrived = []
    for step in range(20_500):
        frames = [frame(step)] if step < 20_000 else []
        arrived += [(step * STEP_US, raw) for raw in wire.carry(frames, step * STEP_US)]
    return arrived


@pytest.mark.parametrize("burst_packets", [1.0, 8.0])
def test_as_many_are_lost_as_asked_in_runs_as_long_as_asked(burst_packets: float) -> None:
    arrived = carried(loss=0.2, burst_packets=burst_packets)
    there = np.zeros(20_000, bool)
    there[[number_in(raw) for _, raw in arrived]] = True
    assert 1 - there.mean() == pytest.approx(0.2, abs=0.025)
    starts = (~there[1:] & there[:-1]).sum()
    # Chance alone makes runs of 1 / (1 - 0.2).
    assert (~there).sum() / starts == pytest.approx(max(burst_packets, 1.25), rel=0.1)


def test_the_share_that_is_overtaken_is_the_one_asked() -> None:
    arrived = carried(reorder=0.1, reorder_by_s=0.02)
    assert np.mean([time_us > number_in(raw) * STEP_US for time_us, raw in arrived]) == pytest.approx(0.1, abs=0.01)
    numbers = [number_in(raw) for _, raw in arrived]
    assert sorted(numbers) == list(range(20_000)) and numbers != sorted(numbers)


def test_bytes_are_split_where_frames_begin() -> None:
    link, chance = dialect.MAVLink(None, 1, 1), random.Random(1)
    messages = [dialect.MAVLink_heartbeat_message(2, 12, 0, chance.randrange(9999), 4, 3) for _ in range(20)]
    frames = [message.pack(link, force_mavlink1=chance.random() < 0.5) for message in messages]
    assert split(b"".join(frames)) == frames
    assert split(b"".join(frames) + b"\x01\x02") == [*frames, b"\x01\x02"]
    assert split(b"".join(frames)[:-1])[-1] == frames[-1][:-1]


def listened_to(*faults: dict[str, Any], seconds: float = 3.0) -> Client:
    """Who listens to a standing vehicle."""
    client = Client(scene=Scene.model_validate({"faults": faults}))
    client.run(seconds)
    return client


def stamps(client: Client, name: str, field: str) -> np.ndarray:
    return np.array([getattr(message, field) for message in client.all(name)])


def test_a_clock_that_jumps_shows_in_every_stamp_and_wraps_where_it_is_narrow() -> None:
    heard = listened_to({"kind": "clock_jump", "at_s": 1.0, "jump_s": 4294966.296 - 1.0})
    wide, narrow = stamps(heard, "HIGHRES_IMU", "time_usec"), stamps(heard, "ATTITUDE", "time_boot_ms")
    assert np.diff(wide).max() == pytest.approx(4294965.3e6, abs=0.05e6)
    # One second after the jump the milliseconds are at their end and begin anew.
    assert narrow.max() > 2**32 - 30 and narrow[-1] < 1100
    assert wide[-1] > 2**32 * 1000
    # Nanoseconds with a sign are as wide as they are: 2**63 of them begin at -2**63.
    moved = restamped(dialect.MAVLink_timesync_message(2**63 - 1000, 5).pack(dialect.MAVLink(None, 1, 1)), 1)
    assert dialect.MAVLink(None).decode(bytearray(moved)).tc1 == -(2**63)


def test_a_battery_that_sags_shows_its_voltage() -> None:
    heard = listened_to({"kind": "battery_sag", "between_s": [0.5, 1.0], "voltage_share": 0.8}, seconds=4.0)
    millivolts = stamps(heard, "SYS_STATUS", "voltage_battery")
    assert millivolts[-1] / millivolts[0] == pytest.approx(0.8, abs=0.01)


def test_what_has_no_stamp_of_the_vehicles_is_left_alone() -> None:
    link = dialect.MAVLink(None, 1, 1)
    heartbeat = dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3).pack(link)
    answer = dialect.MAVLink_ping_message(777, 1, 255, 190).pack(link)
    assert restamped(heartbeat, 10**6) == heartbeat
    assert restamped(answer, 10**6) == answer
    assert restamped(b"\xfd\x01", 10**6) == b"\xfd\x01"
    assert restamped(heartbeat[:-1] + b"\x00", 10**6) == heartbeat[:-1] + b"\x00"
