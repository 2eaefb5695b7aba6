"""A ground station with a pilot at its sticks, on a link of its own."""

from typing import Any

from bench.fly.packets import ARM, GROUND_STATION, SET_MODE, made
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.vehicle import SimulatedVehicle

# Of PX4's modes, as DO_SET_MODE takes them: main and sub mode.
MODES = {"ALTCTL": (2, 0), "POSCTL": (3, 0), "AUTO.RTL": (4, 5), "AUTO.LAND": (4, 6), "STABILIZED": (7, 0)}
# The sticks' way is from -1000 to 1000, the throttle's from 0 to 1000.
FULL_STICK, HALF_THROTTLE = 1000, 500


class GroundStation:
    """What it sends reaches the vehicle with the next interval; nobody reads what it hears."""

    def __init__(self, vehicle: SimulatedVehicle, kind: LinkKind) -> None:
        self._link, self._sent = vehicle.add_link(kind), 0

    def hear(self) -> None:
        self._link.take()

    def beat(self) -> None:
        """Due once a second."""
        self._send("HEARTBEAT", type=6, autopilot=8)

    def arm(self) -> None:
        self._command(ARM, 1.0)

    def set_mode(self, mode: str) -> None:
        self._command(SET_MODE, 1.0, *MODES[mode])

    def move_sticks(self, roll: float = 0.0, pitch: float = 0.0, throttle: float = 0.0, yaw: float = 0.0) -> None:
        """From -1 to 1: right, forward, up and clockwise are positive."""
        x, y, r = (round(FULL_STICK * _limited(stick)) for stick in (pitch, roll, yaw))
        z = round(HALF_THROTTLE * (1.0 + _limited(throttle)))
        self._send("MANUAL_CONTROL", target=1, x=x, y=y, z=z, r=r)

    def _command(self, number: int, *params: float) -> None:
        fields = {f"param{place}": value for place, value in enumerate(params, start=1)}
        self._send("COMMAND_LONG", target_system=1, target_component=1, command=number, **fields)

    def _send(self, name: str, **fields: Any) -> None:
        self._sent += 1
        self._link.push(made(name, fields, GROUND_STATION, self._sent % 256))


def _limited(stick: float) -> float:
    return min(max(stick, -1.0), 1.0)
