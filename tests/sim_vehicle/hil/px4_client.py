"""PX4's side of the external simulator: a TCP client that greets, listens and answers one for one."""

import socket
from collections.abc import Iterator

from pymavlink.dialects.v20 import development as dialect

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
