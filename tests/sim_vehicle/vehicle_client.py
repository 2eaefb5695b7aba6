"""A MAVLink client joined in memory to a simulated vehicle."""

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle

ARM_DISARM, SET_MODE, TAKEOFF, LAND = 400, 176, 22, 21
SET_INTERVAL, REQUEST_MESSAGE = 511, 512
POSITION_ONLY = 0xDF8

IGNORED = (0.0,) * 3


class Client:
    """Sends packets, lets virtual time pass, and keeps what came back."""

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
        self.vehicle = SimulatedVehicle(airframe or load_built_in("foldable"), scene or Scene(), seed, **more)
        self.sent: list[bytes] = []
        self.received: list[tuple[float, Any]] = []
        self._last: dict[str, Any] = {}
        self._link = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self._parser = dialect.MAVLink(None)
        self._waiting = b""

    @property
    def time_s(self) -> float:
        return 1e-6 * self.vehicle.time_boot_us

    def send(self, message: Any) -> None:
        self._waiting += message.pack(self._link)
        self._link.seq = (self._link.seq + 1) % 256

    def send_raw(self, raw: bytes) -> None:
        self._waiting += raw

    def command(self, number: int, *params: float, target: tuple[int, int] = (1, 1)) -> None:
        # A takeoff at place and height 0 would be one into the sea off Africa: not given is NaN.
        unset = math.nan if number == TAKEOFF else 0.0
        padded = [*params, *[unset] * (7 - len(params))]
        self.send(dialect.MAVLink_command_long_message(*target, number, 0, *padded))

    def setpoint(self, north: float, east: float, down: float) -> None:
        fields = (north, east, down, *IGNORED, *IGNORED, 0.0, 0.0)
        self.send(dialect.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, POSITION_ONLY, *fields))

    def heartbeat(self, kind: int = 18) -> None:
        self.send(dialect.MAVLink_heartbeat_message(kind, 8, 0, 0, 4, 3))

    def step(self) -> None:
        waiting, self._waiting = self._waiting, b""
        for raw in self.vehicle.step(waiting):
            self.sent.append(raw)
            message = self._parser.decode(bytearray(raw))
            self._last[message.get_type()] = message
            self.received.append((self.time_s, message))

    def run(self, seconds: float, each_50_ms: Callable[[], None] | None = None) -> None:
        for number in range(round(seconds * 250)):
            if each_50_ms is not None and number % 12 == 0:
                each_50_ms()
            self.step()

    def run_until(
        self, condition: Callable[[], bool], at_most_s: float, each_50_ms: Callable[[], None] | None = None
    ) -> float:
        """Seconds until the condition holds."""
        start_s, number = self.time_s, 0
        while not condition():
            assert self.time_s - start_s < at_most_s, f"not within {at_most_s} s"
            if each_50_ms is not None and number % 12 == 0:
                each_50_ms()
            number += 1
            self.step()
        return self.time_s - start_s

    def all(self, kind: str) -> list[Any]:
        return [message for _, message in self.received if message.get_type() == kind]

    def last(self, kind: str) -> Any:
        assert kind in self._last, f"no {kind} received"
        return self._last[kind]

    def rate_hz(self, kind: str, seconds: float) -> float:
        """Received from now on."""
        self.forget()
        self.run(seconds)
        return len(self.all(kind)) / seconds

    def forget(self) -> None:
        self.received.clear()

    def results(self, number: int) -> list[int]:
        return [ack.result for ack in self.all("COMMAND_ACK") if ack.command == number]

    def armed(self) -> bool:
        return "HEARTBEAT" in self._last and bool(self._last["HEARTBEAT"].base_mode & 128)

    def position(self) -> tuple[float, float, float]:
        message = self.last("LOCAL_POSITION_NED")
        return message.x, message.y, message.z

    def speed(self) -> float:
        message = self.last("LOCAL_POSITION_NED")
        return math.hypot(message.vx, message.vy, message.vz)
