"""The plant as a whole: it hovers, senses as a Pixhawk does, knows itself as badly as stated, or begins in flight."""

import math
import subprocess
import sys

import numpy as np
import pytest

from bench.cases.vehicles import vehicle_of
from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.control.attitude import attitude_control
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.physics.layout import constants_from, initial_state
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle
from tests.sim_vehicle.estimator.flying import filtered
from tests.sim_vehicle.physics.throwing import flown, quiet

KERNELS = """
from sim_vehicle.airframe import load_built_in
from sim_vehicle.control.setpoint import AttitudeSetpoint
from sim_vehicle.physics.rotation import matrix_from_quaternion
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene

plant = Plant(load_built_in("foldable"), Scene(), 1)
plant.step(None, False)
known = len(matrix_from_quaternion.signatures)
plant.step(AttitudeSetpoint((1.0, 0.0, 0.0, 0.0), 0.5), True)
assert len(matrix_from_quaternion.signatures) == known
"""


def test_the_first_attitude_of_a_flight_finds_its_kernel_compiled() -> None:
    # In a process of its own, which nobody else has warmed
    subprocess.run([sys.executable, "-c", KERNELS], check=True)


def at(north: float, east: float, down: float) -> TrajectorySetpoint:
    return TrajectorySetpoint((north, east, down), yaw_rad=0.0)


def hovering(airframe: Airframe, seed: int = 1, **scene: object) -> Plant:
    plant = Plant(airframe, Scene.model_validate(scene), seed)
    flown(plant, at(0, 0, -2), 8)
    return plant


def test_a_tipped_vehicle_thrusts_as_it_would_to_hover() -> None:
    """As PX4: the thrust is what holds the height once the vehicle leans as asked, not what does so now."""
    plant = hovering(quiet(load_built_in("foldable")))
    half = math.radians(75) / 2
    plant.state.body[6:10] = [math.cos(half), 0, -math.sin(half), 0]
    plant.state.body[10:13] = 0
    flown(plant, at(0, 0, -2), 0.012)
    assert plant.state.collective_n == pytest.approx(1.112 * 9.81, rel=0.05)


@pytest.mark.parametrize(("down_m_s2", "leant_m_s2", "thrust_n"), [(20.0, 0.0, 0.12 * 14.016), (-20.0, 1.0, 14.016)])
def test_thrust_ends_where_px4s_does(down_m_s2: float, leant_m_s2: float, thrust_n: float) -> None:
    """MPC_THR_MIN of all thrust when asked to fall; all of it when asked to climb, and then it still leans a little."""
    plant = hovering(quiet(load_built_in("foldable")))
    asked = TrajectorySetpoint(acceleration_ned_m_s2=(leant_m_s2, 0.0, down_m_s2), yaw_rad=0.0)
    flown(plant, asked, 0.012)
    assert plant.state.collective_n == pytest.approx(thrust_n, rel=0.01)
    lean = plant.state.attitude_setpoint[0, 2] / plant.state.attitude_setpoint[2, 2]
    assert (lean < -0.05) == (leant_m_s2 > 0.0)


@pytest.mark.parametrize(("yaw_deg", "rate_rad_s"), [(0, 7.0), (160, 0.0), (180, 0.0), (180, 7.0)])
def test_a_spun_vehicle_still_flies_where_it_should_while_it_turns_back(yaw_deg: float, rate_rad_s: float) -> None:
    """As an off-centre hit leaves it: moving sideways, its nose far from the asked heading or turning away."""
    plant = hovering(quiet(load_built_in("foldable")))
    half = math.radians(yaw_deg) / 2
    plant.state.body[4] = 1.0
    plant.state.body[6:10] = [math.cos(half), 0.0, 0.0, math.sin(half)]
    plant.state.body[12] = rate_rad_s
    flown(plant, at(-1, 0, -2), 4)
    position = plant.truth.series()["position_ned_m"][-1000:]
    assert position[:, 0].min() > -1.05
    assert np.abs(position[:, 1]).max() < 0.4
    assert position[:, 2].max() + 2 < 0.1


def test_the_attitude_control_carries_what_turning_and_folding_do() -> None:
    """Eq. 5 without errors and damping: tau = W x J W + J' W, whatever J is."""
    airframe = load_built_in("foldable")
    constants = constants_from(airframe, np.random.default_rng(1))
    constants.gyroscope_bias_frd_rad_s[:] = 0.0
    state = initial_state((0.0, 0.0, -2.0), 0.0)
    constants.k_omega[:] = 0.0
    state.body[10:13] = rates = np.array([2.0, -3.0, 5.0])
    state.inertia[:], state.inertia_rate[:] = [0.0031, 0.0030, 0.0049, 0.0002], [-0.01, -0.02, -0.03, 0.004]
    attitude_control(state, constants, 0.0)

    def full(entries: np.ndarray) -> np.ndarray:
        xx, yy, zz, xy = entries
        return np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, zz]])

    expected = np.cross(rates, full(state.inertia) @ rates) + full(state.inertia_rate) @ rates
    assert state.moment_frd_n_m == pytest.approx(expected)


def test_raw_samples_are_clipped_before_the_mean() -> None:
    """A rigid hit of over 3000 m/s2 for 1 ms shows as 16 g for a quarter of the 4 ms mean, not more."""
    airframe = quiet(load_built_in("rigid"))
    wall = {"point_ned_m": [1, 0, -2], "normal_ned": [-1, 0, 0]}
    plant = Plant(airframe, Scene.model_validate({"walls": [wall]}), seed=1)
    plant.state.body[0:6] = [1 - 0.1825 - 0.002, 0, -2, 2.0, 0, 0]
    outputs = flown(plant, None, 0.02)
    seen = sum(output.specific_force_frd_m_s2[0] for output in outputs) * 0.004
    clip = airframe.imu.accelerometer_range_m_s2
    assert outputs[-1].clipping_counts[0] == pytest.approx(0.001 / 125e-6, abs=1)
    assert -0.0012 * clip < seen < -0.0008 * clip
    assert min(output.specific_force_frd_m_s2[0] for output in outputs) > -0.32 * clip


def test_a_sensor_above_the_centre_shows_force_and_velocity_of_its_own() -> None:
    # Given a vehicle without drag, whose only force is along its own z axis, and its sensor 5 cm above the centre
    plant = hovering(quiet(load_built_in("foldable"), imu__above_centre_m=0.05))
    start, before = len(plant.truth.series()["time_boot_us"]), plant.state.body[10:12].copy()
    # When it turns to fly north-east
    outputs = flown(plant, at(2, 1, -2), 0.1)
    # Then sideways the sensor shows how its place turns, and the velocity is that of its place, as late as all is
    p, q = plant.state.body[10:12] - before
    force = sum(np.array(output.specific_force_frd_m_s2) for output in outputs) * 0.004
    assert abs(q) > 0.3
    assert force[:2] == pytest.approx([-0.05 * q, 0.05 * p], rel=2e-3)
    moved = outputs[-1].velocity_ned_m_s - plant.truth.series()["velocity_ned_m_s"][start + len(outputs) - 6]
    p, q, _ = outputs[-6].angular_velocity_frd_rad_s
    assert moved[:2] == pytest.approx([-0.05 * q, 0.05 * p], rel=0.1)


def test_a_sensor_beside_the_centre_shows_that_the_vehicle_spins() -> None:
    # Given a vehicle that spins at 8 rad/s, and its sensor 5 cm ahead of the centre and 2 cm to the right
    plant = hovering(quiet(load_built_in("foldable"), imu__ahead_of_centre_m=0.05, imu__right_of_centre_m=0.02))
    plant.state.body[12] = 8.0
    # When that is braked
    (output,) = flown(plant, at(0, 0, -2), 0.004)
    # Then the sensor is held on its circle, and braked along it
    braked = (plant.state.body[12] - 8.0) / 0.004
    assert braked < -0.5
    expected = [-0.05 * 64.0 - 0.02 * braked, -0.02 * 64.0 + 0.05 * braked]
    assert output.specific_force_frd_m_s2[:2] == pytest.approx(expected, abs=0.02)


def test_the_estimate_is_late_and_as_noisy_as_stated() -> None:
    airframe = filtered(changes={"estimate": {"kind": "markov"}})
    plant = hovering(airframe, seed=5)
    start = len(plant.truth.series()["time_boot_us"])
    outputs = flown(plant, at(0, 0, -2), 60)
    truth = plant.truth.series()
    true_velocity = truth["velocity_ned_m_s"][start - 5 : -5]
    error = np.array([output.velocity_ned_m_s for output in outputs]) - true_velocity
    assert np.sqrt((error**2).mean(axis=0)) == pytest.approx([0.032] * 3, rel=0.25)
    assert np.sqrt((error**2).mean()) >= 0.03 * 0.9
    position_error = np.array([output.position_ned_m for output in outputs]) - truth["position_ned_m"][start - 5 : -5]
    assert 0.005 < np.sqrt((position_error**2).mean()) < 0.02


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
