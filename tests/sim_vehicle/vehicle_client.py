"""Who speaks MAVLink with a simulated vehicle in memory, and what has been heard."""

import math
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle

ARM_DISARM, SET_MODE, TAKEOFF, LAND = 400, 176, 22, 21
SET_INTERVAL, REQUEST_MESSAGE = 511, 512
POSITION_ONLY = 0xDF8

IGNORED = (0.0,) * 3


def heard_until(connection: socket.socket, wanted: set[str]) -> set[str]:
    """The kinds of what comes until all that is wanted has come; the socket's time-out ends a vain wait."""
    parser, heard = dialect.MAVLink(None), set()
    parser.robust_parsing = True
    while not wanted <= heard:
        heard |= {message.get_type() for message in parser.parse_buffer(connection.recv(65_536)) or []}
    return heard


@contextmanager
def in_a_thread(serves: Callable[..., None], *arguments: Any) -> Iterator[None]:
    """It serves until the block ends."""
    stop = threading.Event()
    thread = threading.Thread(target=serves, args=arguments, kwargs={"stop": stop.is_set})
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(5.0)
        assert not thread.is_alive()


class End:
    """The other end of a link: sends packets, and keeps what came back and when."""

    def __init__(self, push: Callable[[bytes], object], system: int = 255, component: int = 190) -> None:
        self.push = push
        self.mav = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self.packets: list[bytes] = []
        self.received: list[tuple[float, Any]] = []
        self._last: dict[str, Any] = {}
        self._parser = dialect.MAVLink(None)
        self._parser.robust_parsing = True

    def send(self, message: Any) -> bytes:
        raw: bytes = message.pack(self.mav)
        self.mav.seq = (self.mav.seq + 1) % 256
        self.push(raw)
        return raw

    def command(self, number: int, *params: float, target: tuple[int, int] = (1, 1)) -> bytes:
        # A takeoff at place and height 0 would be one into the sea off Africa: not given is NaN.
        unset = math.nan if number == TAKEOFF else 0.0
        padded = [*params, *[unset] * (7 - len(params))]
        return self.send(dialect.MAVLink_command_long_message(*target, number, 0, *padded))

    def setpoint(self, north: float, east: float, down: float) -> None:
        fields = (north, east, down, *IGNORED, *IGNORED, 0.0, 0.0)
        self.send(dialect.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, POSITION_ONLY, *fields))

    def heartbeat(self, kind: int = dialect.MAV_TYPE_GCS) -> bytes:
        return self.send(dialect.MAVLink_heartbeat_message(kind, 8, 0, 0, 4, 3))

    def hear(self, packets: Iterable[bytes], time_s: float) -> None:
        for raw in packets:
            self.packets.append(raw)
            for message in self._parser.parse_buffer(raw) or []:
                self._last[message.get_type()] = message
                self.received.append((time_s, message))

    def all(self, kind: str) -> list[Any]:
        return [message for _, message in self.received if message.get_type() == kind]

    def times(self, kind: str) -> list[float]:
        return [time_s for time_s, message in self.received if message.get_type() == kind]

    def last(self, kind: str) -> Any:
        assert kind in self._last, f"no {kind} received"
        return self._last[kind]

    def forget(self) -> None:
        self.packets.clear()
        self.received.clear()

    def results(self, number: int) -> list[int]:
        return [ack.result for ack in self.all("COMMAND_ACK") if ack.command == number]

    def armed(self) -> bool:
        return "HEARTBEAT" in self._last and bool(self._last["HEARTBEAT"].base_mode & 128)

    def position(self) -> tuple[float, float, float]:
        message = self.last("LOCAL_POSITION_NED")
        return message.x, message.y, message.z


class Client(End):
    """With a vehicle of its own, whose virtual time it lets pass."""

    def __init__(
        self,
        seed: int = 1,
        system: int = 1,
        component: int = 191,
        airframe: Airframe | None = None,
        scene: Scene | None = None,
        **more: Any,
    ) -> None:
        """``more``: the vehicle's own arguments."""
        super().__init__(self._wait, system, component)
        self.vehicle = SimulatedVehicle(airframe or load_built_in("foldable"), scene or Scene(), seed, **more)
        self._waiting = b""

    def _wait(self, raw: bytes) -> None:
        self._waiting += raw

    @property
    def time_s(self) -> float:
        return 1e-6 * self.vehicle.time_boot_us

    def step(self) -> None:
        waiting, self._waiting = self._waiting, b""
        packets = self.vehicle.step(waiting)
        self.hear(packets, self.time_s)

    def run(self, seconds: float, each_50_ms: Callable[[], None] | None = None) -> None:
        for number in range(round(seconds * 250)):
            if each_50_ms is not None and number % 12 == 0:
                each_50_ms()
            self.step()

    def take_off(self, seconds: float) -> None:
        """And so long in the air."""
        self.command(TAKEOFF)
        self.command(ARM_DISARM, 1)
        self.run(seconds)

    def rate_hz(self, kind: str, seconds: float) -> float:
        """Received from now on."""
        self.forget()
        self.run(seconds)
        return len(self.all(kind)) / seconds
