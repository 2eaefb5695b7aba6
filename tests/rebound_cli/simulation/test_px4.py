"""What the command line offers for a real PX4, as far as it can be shown without one."""

import signal
import socket

import pytest

from tests.rebound_cli.command import WALL, processes_naming, run_here, start, wait_until_gone
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


def test_the_body_alone_serves_a_px4_and_writes_the_truth(tmp_path):
    port, path = SIMULATOR_PORT, tmp_path / "truth.npz"
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


@pytest.mark.parametrize(
    ("kind", "port"), [(socket.SOCK_DGRAM, 14540 + INSTANCE), (socket.SOCK_STREAM, SIMULATOR_PORT)]
)
def test_a_port_that_is_taken_is_one_sentence(tmp_path, kind, port):
    with socket.socket(socket.AF_INET, kind) as other:
        other.bind(("0.0.0.0", port))
        if kind == socket.SOCK_STREAM:
            other.listen(1)
        result = run_here("fly", WALL, "--sim", "px4", "--instance", INSTANCE, "--out", tmp_path / "run")
    sentence = result.stderr.strip().splitlines()[-1]
    assert result.returncode == 1 and sentence.startswith("rebound: ") and str(port) in sentence
    # Tried before anything is written
    assert kind == socket.SOCK_STREAM or not (tmp_path / "run").exists()
