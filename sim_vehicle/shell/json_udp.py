"""The simulated vehicle's body for a real ArduPilot: states over UDP, and MAVLink over the TCP port of its SITL."""

import socket
import time
from collections.abc import Callable
from contextlib import closing
from typing import Self

from sim_vehicle.errors import VehicleEnded
from sim_vehicle.json.messages import Pulses, pulses_from
from sim_vehicle.json.vehicle import JsonVehicle
from sim_vehicle.shell.ports import Address, bound_socket

# Of the SITL's instance 0; each further one has them ten higher (SITL_cmdline.cpp).
MAVLINK_PORT, JSON_PORT, PORTS_APART = 5760, 9002, 10
# Ctrl-C is looked at this often while the SITL has not started.
_LOOK_S = 0.1
# A SITL that waits sends its pulses again each second; one that is silent for ten times that has ended.
_SILENCE_S = 10.0
_RECEIVE_BYTES = 65_536
# ArduPilot's estimate is good enough to arm by after 42 s (measured).
READY_US = 50_000_000


class ArduPilotVehicle:
    """ArduPilot with our body, as one vehicle in lockstep: MAVLink in, one sample of time, MAVLink out.

    MAVLink has no part in ArduPilot's own lockstep. So the state that lets it go on is held back until what it has said
    was heard, and answered.
    """

    def __init__(self, body: JsonVehicle, instance: int, is_stopped: Callable[[], bool]) -> None:
        """Waits for the SITL to start. Raises PortInUse, and VehicleEnded when stopped."""
        self._body, self.truth, self._is_stopped = body, body.truth, is_stopped
        self._answered: int | None = None
        self._states = bound_socket(socket.SOCK_DGRAM, "127.0.0.1", JSON_PORT + PORTS_APART * instance)
        self._states.settimeout(_SILENCE_S)
        try:
            self._mavlink = _met(MAVLINK_PORT + PORTS_APART * instance, is_stopped)
        except VehicleEnded:
            self._states.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._states.close()
        self._mavlink.close()

    @property
    def time_boot_us(self) -> int:
        return self._body.time_boot_us

    def start(self) -> None:
        """Return when it can be armed; what it says until then is old."""
        while self.time_boot_us < READY_US and not self._is_stopped():
            self.step(b"")

    def step(self, received: bytes) -> list[bytes]:
        """`received`: MAVLink for it. Returns what it has said. Raises VehicleEnded when it has ended."""
        try:
            if received:
                self._mavlink.sendall(received)
            pulses, sender = self._pulses()
            said = self._heard()
            self._states.sendto(self._body.answer(pulses), sender)
        except (TimeoutError, ConnectionError) as problem:
            raise VehicleEnded("ArduPilot's SITL has ended, or does not fly with --model JSON.") from problem
        return said

    def _pulses(self) -> tuple[Pulses, Address]:
        """The next ones. On one machine no answer is lost: what is said once more has been answered since."""
        while True:
            packet, sender = self._states.recvfrom(_RECEIVE_BYTES)
            pulses = pulses_from(packet)
            if pulses is not None and pulses.count != self._answered:
                self._answered = pulses.count
                return pulses, sender

    def _heard(self) -> list[bytes]:
        try:
            return [self._mavlink.recv(_RECEIVE_BYTES, socket.MSG_DONTWAIT)]
        except BlockingIOError:
            return []


def _met(port: int, is_stopped: Callable[[], bool]) -> socket.socket:
    while not is_stopped():
        link = socket.socket()
        try:
            link.connect(("127.0.0.1", port))
        except ConnectionRefusedError:
            with closing(link):
                time.sleep(_LOOK_S)
            continue
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return link
    raise VehicleEnded("The flight was stopped before ArduPilot's SITL was there.")
