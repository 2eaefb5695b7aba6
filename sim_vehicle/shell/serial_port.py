"""A serial line."""

import contextlib

import serial

from sim_vehicle.errors import PortInUse
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.shell.port import connected
from sim_vehicle.vehicle import SimulatedVehicle


class SerialPort:
    """What the line cannot carry at its speed is lost."""

    def __init__(self, vehicle: SimulatedVehicle, kind: LinkKind, device: str, baud: int) -> None:
        """Raises PortInUse where the device cannot be opened."""
        try:
            self._serial = serial.Serial(device, baud, timeout=0, write_timeout=0)
        except (OSError, ValueError) as problem:
            raise PortInUse(f"Serial port {device} cannot be opened: {problem}") from problem
        self._link = connected(vehicle, kind)

    def receive(self) -> None:
        # A line that is unplugged falls silent.
        with contextlib.suppress(OSError):
            self._link.push(self._serial.read(self._serial.in_waiting))

    def send(self) -> None:
        for packet in self._link.take():
            with contextlib.suppress(OSError, serial.SerialTimeoutException):
                self._serial.write(packet)

    def close(self) -> None:
        self._serial.close()
