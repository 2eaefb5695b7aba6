"""`rebound preflight` on the simulated vehicle, through the wire."""

from companion.mission.config import CompanionConfig
from companion.preflight import Preflight, Verdict
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle
from tests.rebound_cli.command import run_here


def surveyed() -> tuple[Preflight, SimulatedVehicle]:
    vehicle = SimulatedVehicle(load_built_in("foldable"), Scene(), seed=1, keeps_path=False)
    preflight = Preflight(CompanionConfig(), vehicle.time_boot_us)
    while not preflight.finished:
        exchange(preflight, vehicle)
    return preflight, vehicle


def exchange(preflight: Preflight, vehicle: SimulatedVehicle, sending: tuple[bytes, ...] = ()) -> None:
    frames = vehicle.step(b"".join(sending))
    answer = preflight.step(b"".join(frames), vehicle.time_boot_us)
    if answer:
        exchange(preflight, vehicle, answer)


def test_the_simulated_vehicle_is_found_ready_but_for_what_a_fresh_px4_leaves_open():
    preflight, _ = surveyed()
    found = {finding.item: finding for finding in preflight.findings()}
    assert preflight.survey.vehicle.identity is not None
    assert not [item for item, finding in found.items() if finding.verdict is Verdict.BAD]
    assert [item for item, finding in found.items() if finding.fix] == [
        "COM_OBL_RC_ACT",
        "COM_RCL_EXCEPT",
        "MPC_ACC_HOR",
    ]
    # and 247 of the 250 samples a second arrive: PX4's link loses 1.2 %
    assert found["HIGHRES_IMU"].found.startswith("247 Hz")


def test_a_remedy_that_is_taken_is_taken_by_the_vehicle():
    preflight, vehicle = surveyed()
    exchange(preflight, vehicle, preflight.set_parameter("COM_RCL_EXCEPT", 4, vehicle.time_boot_us))
    for _ in range(25):
        exchange(preflight, vehicle)
    assert preflight.parameter("COM_RCL_EXCEPT") == 4
    assert {finding.item: finding for finding in preflight.findings()}["COM_RCL_EXCEPT"].verdict is Verdict.GOOD


def test_an_address_that_is_none_is_one_sentence():
    done = run_here("preflight", "--connect", "nowhere")
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    assert "'nowhere' is not a connection address" in done.stderr
