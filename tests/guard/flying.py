"""A guard, somebody else who commands, and a simulated vehicle, joined by bytes on virtual time."""

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from companion.guard.states import State
from companion.report import Event
from sim_vehicle.airframe import load_built_in
from sim_vehicle.mavlink.link import LinkOptions
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle

EPOCH_US = 1_600_000_000_000_000
SET_MODE, ARM, TAKEOFF = 176, 400, 22
WALL = {"point_ned_m": [4, 0, -1.5], "normal_ned": [-1, 0, 0], "width_m": 20, "height_m": 20}
POSITION_ONLY, VELOCITY_ONLY = 0xDF8, 0xDC7
MANUAL_POSITION, OFFBOARD, HOLD, MISSION, LAND = (3, 0), (6, 0), (4, 3), (4, 4), (4, 6)


class Air:
    """The guard on one link, the pilot or the program on another; `on_wire` sees all that reaches the vehicle."""

    def __init__(
        self,
        config: GuardConfig | None = None,
        scene: dict[str, Any] | None = None,
        parameters: dict[str, float] | None = None,
        airframe: str = "foldable",
    ) -> None:
        built = Scene.model_validate({"walls": [WALL], **(scene or {})})
        self.vehicle = SimulatedVehicle(load_built_in(airframe), built, 1, parameters=parameters)
        self.guard = Guard(config or GuardConfig())
        self._guard_link = self.vehicle.add_link(LinkOptions(LinkKind.ONBOARD))
        self._other_link = self.vehicle.add_link(LinkOptions(LinkKind.NORMAL))
        self._other = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
        self._parser, self._reader = dialect.MAVLink(None), dialect.MAVLink(None)
        self._guards_bytes = self._others_bytes = b""
        self.each_step: list[Callable[[], None]] = []
        self.others_last: dict[str, Any] = {}
        self.events: list[Event] = []
        self.on_wire: list[tuple[float, str, Any]] = []
        self.keep_guard_silent = False
        self._next_beat_s = 0.0

    @property
    def time_s(self) -> float:
        return 1e-6 * self.vehicle.time_boot_us

    @property
    def state(self) -> State:
        return State.CONNECTING if self.guard.core is None else self.guard.core.machine.state

    def send(self, message: Any) -> None:
        self._others_bytes += message.pack(self._other)
        self._other.seq = (self._other.seq + 1) % 256

    def command(self, number: int, *params: float) -> None:
        unset = math.nan if number == TAKEOFF else 0.0
        self.send(dialect.MAVLink_command_long_message(1, 1, number, 0, *params, *[unset] * (7 - len(params))))

    def mode(self, main_and_sub: tuple[int, int]) -> None:
        self.command(SET_MODE, 1, *main_and_sub)

    def sticks(self, forward: float = 0.0, right: float = 0.0) -> None:
        pitch, roll = round(1000 * forward), round(1000 * right)
        self.send(dialect.MAVLink_manual_control_message(1, pitch, roll, 500, 0, 0))

    def velocity(self, north: float, east: float = 0.0, down: float = 0.0) -> None:
        fields = (0.0, 0.0, 0.0, north, east, down, 0.0, 0.0, 0.0, 0.0, 0.0)
        self.send(dialect.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, VELOCITY_ONLY, *fields))

    def step(self) -> None:
        if self.time_s >= self._next_beat_s:
            self._next_beat_s = self.time_s + 1.0
            self.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        for action in self.each_step:
            action()
        self._note("guard", self._guards_bytes)
        self._note("other", self._others_bytes)
        self._guard_link.push(self._guards_bytes)
        self._other_link.push(self._others_bytes)
        self._others_bytes = b""
        self.vehicle.advance()
        for packet in self._other_link.take():
            message = self._reader.decode(bytearray(packet))
            self.others_last[message.get_type()] = message
        result = self.guard.step(b"".join(self._guard_link.take()), EPOCH_US + self.vehicle.time_boot_us)
        self._guards_bytes = b"" if self.keep_guard_silent else b"".join(result.sent_frames)
        self.events += result.events

    def guard_hears(self, forged: bytes) -> list[Event]:
        """Somebody sends this in the vehicle's name."""
        result = self.guard.step(forged, EPOCH_US + self.vehicle.time_boot_us)
        self._guards_bytes += b"".join(result.sent_frames)
        self.events += result.events
        return list(result.events)

    def _note(self, sender: str, sent: bytes) -> None:
        for message in self._parser.parse_buffer(bytearray(sent)) or [] if sent else []:
            self.on_wire.append((self.time_s, sender, message))

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 250)):
            self.step()

    def until(self, condition: Callable[[], bool], at_most_s: float) -> float:
        """Seconds until the condition holds."""
        start_s = self.time_s
        while not condition():
            assert self.time_s - start_s < at_most_s, (f"not within {at_most_s} s", self.state, self.told())
            self.step()
        return self.time_s - start_s

    def every(self, seconds: float, action: Callable[[], None]) -> Callable[[], None]:
        """Do it from now on, again and again; the action returned ends it."""
        due_s = [self.time_s]

        def act() -> None:
            if self.time_s >= due_s[0]:
                due_s[0] = self.time_s + seconds
                action()

        self.each_step.append(act)
        return lambda: self.each_step.remove(act)

    def told(self, kind: str | None = None) -> list[str]:
        return [event.text for event in self.events if kind in (None, event.kind)]

    def event(self, kind: str) -> Event:
        return next(event for event in self.events if event.kind == kind)

    def setpoints(self, sender: str, since_s: float = 0.0) -> list[tuple[float, Any]]:
        kind = "SET_POSITION_TARGET_LOCAL_NED"
        return [(at, m) for at, who, m in self.on_wire if who == sender and m.get_type() == kind and at >= since_s]

    def vehicle_mode(self) -> str:
        return self.guard.status().vehicle_mode

    def position(self) -> tuple[float, float, float]:
        position = self.guard.status().position_ned_m
        assert position is not None
        return position

    def take_off(self) -> None:
        """By the other's commands: up to PX4's take-off height and hold."""
        self.until(lambda: self.state is State.STANDING_BY, 10.0)
        self.until(lambda: self.others_last.get("HEARTBEAT") is not None and self._is_ready(), 20.0)
        self.command(ARM, 1)
        self.run(0.5)
        self.command(TAKEOFF)
        self.until(lambda: self.state is State.WATCHING, 20.0)
        self.until(lambda: self.vehicle_mode() == "AUTO.LOITER", 20.0)

    def _is_ready(self) -> bool:
        return bool(self.others_last["HEARTBEAT"].system_status == 3)
