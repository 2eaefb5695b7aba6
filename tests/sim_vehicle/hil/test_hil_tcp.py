"""The TCP server as PX4 meets it: boot, lockstep, speed, a PX4 that goes and the next one."""

import socket
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.airframe import load_built_in
from sim_vehicle.hil.messages import MOTORS_STOPPED
from sim_vehicle.hil.vehicle import HilVehicle
from sim_vehicle.scene import Scene
from sim_vehicle.shell.hil_tcp import serve_px4
from sim_vehicle.shell.truth_file import load_clock, load_truth
from tests.clients.simulator import free_port
from tests.sim_vehicle.vehicle_client import in_a_thread

TIMEOUT_S = 5.0
HOVER = [0.78] * 4


class Px4Client:
    """As `SimulatorMavlink.cpp`: takes its clock from HIL_SENSOR and answers with that time."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), TIMEOUT_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._link = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
        self._waiting: list = []
        self.times_us: list[int] = []
        self._socket.sendall(dialect.MAVLink_heartbeat_message(0, 12, 0, 0, 0, 0).pack(self._link))

    def next_step(self) -> list:
        """The messages up to and including the next HIL_SENSOR; raises EOFError when the simulator has gone."""
        step = []
        while True:
            while self._waiting:
                step.append(self._waiting.pop(0))
                if step[-1].get_type() == "HIL_SENSOR":
                    self.times_us.append(step[-1].time_usec)
                    return step
            data = self._socket.recv(65_536)
            if not data:
                raise EOFError
            self._waiting += self._link.parse_buffer(data) or []

    def answer(self, controls: list[float], armed: bool = True) -> None:
        mode = 0x81 if armed else 0x01
        message = dialect.MAVLink_hil_actuator_controls_message(self.times_us[-1], controls + [0.0] * 12, mode, 1)
        self._socket.sendall(message.pack(self._link))

    def fly(self, steps: int, controls: list[float]) -> Iterator[list]:
        """Answer ``steps`` samples, handing out the messages of each."""
        for _ in range(steps):
            step = self.next_step()
            self.answer(controls)
            yield step

    def close(self) -> None:
        self._socket.close()


def new_vehicle() -> HilVehicle:
    return HilVehicle(load_built_in("foldable"), Scene(), 1, sample_interval_us=4_000)


@pytest.fixture(scope="module", autouse=True)
def compiled_physics() -> None:
    """On a machine that has never run them, the kernels compile for longer than PX4's client waits."""
    new_vehicle().step(MOTORS_STOPPED)


@contextmanager
def served(speed: float = 0.0, truth_path: Path | None = None) -> Iterator[tuple[int, list[str]]]:
    """The server in a thread: its port, and what it says."""
    port, said, listening = free_port(socket.SOCK_STREAM), [], threading.Event()

    def tell(text: str) -> None:
        said.append(text)
        listening.set()

    with in_a_thread(partial(serve_px4, new_vehicle, port, speed, truth_path, tell=tell)):
        assert listening.wait(TIMEOUT_S)
        yield port, said


def connected(port: int) -> closing[Px4Client]:
    return closing(Px4Client(port))


DUE_IN_A_SECOND = {"HIL_SENSOR", "HIL_GPS", "HIL_OPTICAL_FLOW", "DISTANCE_SENSOR", "ODOMETRY"}


def boot(px4: Px4Client) -> None:
    """PX4's modules need some samples before the first motor command."""
    for _ in range(12):
        px4.next_step()
    px4.answer([0.0] * 4, armed=False)


def test_px4_boots_on_samples_that_it_does_not_answer_and_then_gets_one_an_answer():
    with served() as (port, _), connected(port) as px4:
        boot(px4)
        steps = list(px4.fly(200, HOVER))
        assert px4.times_us == [4_000 * i for i in range(1, len(px4.times_us) + 1)]
        kinds = {message.get_type() for step in steps for message in step}
        assert kinds == DUE_IN_A_SECOND
        assert all(step[-1].get_type() == "HIL_SENSOR" for step in steps)


def test_a_lost_answer_costs_a_second_and_not_the_flight(tmp_path):
    path = tmp_path / "truth.npz"
    with served(1.0, path) as (port, _), connected(port) as px4:
        boot(px4)
        list(px4.fly(20, HOVER))
        px4.next_step()
        px4.next_step()
        px4.answer(HOVER)
        list(px4.fly(20, HOVER))
        assert px4.times_us == [4_000 * i for i in range(1, len(px4.times_us) + 1)]
    # What stood still is told with the truth: times of before count from another start of the clock.
    (at_us, stood_us), *others = load_clock(path)[0]
    assert not others and at_us == 4_000 * 34 and stood_us >= 900_000


def test_the_next_px4_gets_a_new_vehicle_and_the_truth_of_each_is_written(tmp_path):
    path = tmp_path / "truth.npz"
    with served(truth_path=path) as (port, said):
        with connected(port) as px4:
            boot(px4)
            list(px4.fly(300, [0.9] * 4))
        with connected(port) as px4:
            first = px4.next_step()
            _, series, _ = load_truth(path)
            assert series["position_ned_m"][-1, 2] < -0.3
            assert first[-1].time_usec == 4_000
            boot(px4)
            list(px4.fly(10, [0.0] * 4))
    _, series, _ = load_truth(path)
    assert series["position_ned_m"][-1, 2] > -0.1
    assert sum("has connected" in text for text in said) == 2


def test_only_this_machine_is_listened_to(monkeypatch):
    bound = []
    monkeypatch.setattr(socket.socket, "bind", lambda _, address: bound.append(address))
    serve_px4(new_vehicle, 4560, stop=lambda: True, tell=lambda _: None)
    assert bound == [("127.0.0.1", 4560)]
