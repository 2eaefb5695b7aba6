"""What the command line offers for a real PX4, as far as it can be shown without one."""

import signal
import socket

import pytest

from sim_vehicle.airframe import load_built_in
from sim_vehicle.hil.parameters import px4_parameters
from tests.rebound_cli.command import (
    WALL,
    assert_one_clear_sentence,
    processes_naming,
    run,
    start,
    wait_until_gone,
)
from tests.sim_vehicle.hil.px4_client import Px4Client

pytestmark = pytest.mark.realtime

# Far from the ports of a PX4 that may be running on this machine.
INSTANCE = 9
SIMULATOR_PORT = 4560 + INSTANCE


def next_line_with(process, words):
    for line in process.stdout:
        if words in line:
            return line
    raise AssertionError(f"it ended without saying {words!r}")


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.mark.parametrize("format_name", ["env", "params", "airframe"])
def test_the_airframe_is_printed_whole_in_every_format(format_name):
    result = run("airframe", "px4", "--airframe", "rigid", "--format", format_name)
    assert result.returncode == 0, result.stderr
    for parameter in px4_parameters(load_built_in("rigid")):
        assert parameter.name in result.stdout


def test_the_body_alone_serves_a_px4_and_writes_the_truth(tmp_path):
    port, path = free_port(), tmp_path / "truth.npz"
    options = ("--port", port, "--mission", WALL, "--speed", "0", "--truth", path)
    process = start("sim", "--autopilot", "px4", *options)
    next_line_with(process, f"TCP port {port}")
    px4 = Px4Client(port)
    assert [px4.next_step()[-1].time_usec for _ in range(3)] == [1_000, 2_000, 3_000]
    px4.answer([0.0] * 4)
    next_line_with(process, "PX4 answers")
    px4.close()
    next_line_with(process, "flight ends")
    process.send_signal(signal.SIGINT)
    assert process.wait(10) == 0
    assert path.exists()


def test_ctrl_c_while_waiting_for_px4_ends_everything(tmp_path):
    folder = tmp_path / "run"
    process = start("fly", WALL, "--sim", "px4", "--instance", INSTANCE, "--out", folder)
    assert str(SIMULATOR_PORT) in next_line_with(process, "Waiting for PX4")
    assert processes_naming(folder / "resolved.yaml")
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert process.returncode == 1
    wait_until_gone(folder)


def test_a_companions_port_that_is_taken_leaves_no_folder(tmp_path):
    folder = tmp_path / "run"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("0.0.0.0", 14540 + INSTANCE))
        result = run("fly", WALL, "--sim", "px4", "--instance", INSTANCE, "--out", folder)
    assert_one_clear_sentence(result, 14540 + INSTANCE)
    assert not folder.exists()


def test_a_simulators_port_that_is_taken_is_one_sentence(tmp_path):
    with socket.socket() as other:
        other.bind(("0.0.0.0", SIMULATOR_PORT))
        other.listen(1)
        result = run("fly", WALL, "--sim", "px4", "--instance", INSTANCE, "--json", "--out", tmp_path / "run")
    assert result.returncode == 1
    sentence = result.stderr.strip().splitlines()[-1]
    assert sentence.startswith("rebound: ")
    assert f"TCP port {SIMULATOR_PORT} is in use" in sentence
