"""`rebound preflight` on the simulated vehicle, through the wire."""

import itertools
from collections.abc import Callable

import pytest

from companion.autopilot.setup import SerialLine, Verdict
from companion.mission.config import CompanionConfig
from companion.preflight import Preflight, findings
from rebound_cli.preflight.command import serial_line
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle


def surveyed(damaged: Callable[[bytes], bytes] = bytes) -> tuple[Preflight, SimulatedVehicle]:
    vehicle = SimulatedVehicle(load_built_in("foldable"), Scene(), seed=1, keeps_path=False)
    preflight = Preflight(CompanionConfig(), vehicle.time_boot_us)
    while not preflight.survey.finished:
        exchange(preflight, vehicle, damaged=damaged)
    return preflight, vehicle


def exchange(
    preflight: Preflight,
    vehicle: SimulatedVehicle,
    sending: tuple[bytes, ...] = (),
    damaged: Callable[[bytes], bytes] = bytes,
) -> None:
    frames = vehicle.step(b"".join(sending))
    answer = preflight.step(b"".join(map(damaged, frames)), vehicle.time_boot_us)
    if answer:
        exchange(preflight, vehicle, answer, damaged)


def test_the_simulated_vehicle_is_found_ready_but_for_what_a_fresh_px4_leaves_open():
    preflight, _ = surveyed()
    found = {finding.item: finding for finding in findings(preflight.survey)}
    assert preflight.survey.vehicle.identity is not None
    assert not [item for item, finding in found.items() if finding.verdict is Verdict.BAD]
    assert [item for item, finding in found.items() if finding.fix] == [
        "COM_OBL_RC_ACT",
        "COM_RCL_EXCEPT",
        "MPC_ACC_HOR",
    ]
    assert found["packets"].verdict is found["arrival"].verdict is Verdict.GOOD
    # and 247 of the 250 samples a second arrive: PX4's link loses 1.2 %
    assert found["HIGHRES_IMU"].found.startswith("247 Hz")


def test_packets_that_are_lost_or_damaged_on_the_way_are_counted():
    # Given a line that loses each tenth packet and breaks one byte in each hundredth
    numbers = itertools.count()

    def worn(packet: bytes) -> bytes:
        number = next(numbers)
        if number % 10 == 5:
            return b""
        return packet[:-3] + bytes((packet[-3] ^ 0xFF,)) + packet[-2:] if number % 100 == 0 else packet

    preflight, _ = surveyed(worn)
    delivery = preflight.survey.delivery
    assert delivery.lost == pytest.approx(0.11 * (delivery.received + delivery.lost), rel=0.03)
    assert delivery.unreadable_bytes > 10 * delivery.lost / 11
    finding = {finding.item: finding for finding in findings(preflight.survey)}["packets"]
    assert finding.verdict is Verdict.DOUBTFUL
    assert "(11." in finding.found or "(10." in finding.found


def test_what_the_line_goes_through_is_read_where_linux_tells_it(tmp_path):
    (tmp_path / "sys/bus/usb-serial/devices/ttyUSB0").mkdir(parents=True)
    (tmp_path / "sys/bus/usb-serial/devices/ttyUSB0/latency_timer").write_text("16\n")
    assert serial_line("serial:///dev/ttyUSB0:57600", tmp_path) == SerialLine(57_600, 16)
    assert serial_line("serial:///dev/ttyAMA0:921600", tmp_path) == SerialLine(921_600, None)
    assert serial_line("serial:///dev/ttyACM0:57600", tmp_path) == SerialLine(None, None)
    assert serial_line("udpin://0.0.0.0:14540", tmp_path) is None


def test_a_remedy_that_is_taken_is_taken_by_the_vehicle():
    preflight, vehicle = surveyed()
    exchange(preflight, vehicle, preflight.set_parameter("COM_RCL_EXCEPT", 4, vehicle.time_boot_us))
    for _ in range(25):
        exchange(preflight, vehicle)
    assert preflight.survey.parameters["COM_RCL_EXCEPT"] == 4
    assert {finding.item: finding for finding in findings(preflight.survey)}["COM_RCL_EXCEPT"].verdict is Verdict.GOOD
