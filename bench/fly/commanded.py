"""A vehicle before a wall that somebody commands by MAVLink, and a guard, joined on virtual time.

In `BetweenFlight` the guard is the link, and whoever commands comes as a client of it.
"""

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from bench.fly.virtual_time import EPOCH_US, VirtualTime
from companion.guard.between import Between
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from companion.guard.states import State
from companion.report import Event
from sim_vehicle.airframe import load_built_in
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle

SET_MODE, ARM, TAKEOFF = 176, 400, 22
# From the wall's face to the centre of a vehicle that touches it with guards unfolded: 0.24 m.
FACE_NORTH_M = 4.0
PLACE_ONLY = 0xDF8
MANUAL_POSITION, OFFBOARD, HOLD, MISSION, LAND = (3, 0), (6, 0), (4, 3), (4, 4), (4, 6)
# MAVSDK's Offboard repeats its last setpoint every 50 ms, for ever; in whole intervals of 4 ms.
REPEATED_EVERY_S = 0.052
# Datagrams, with Linux's default buffer (see connection.MOST_DATAGRAMS of the companion's); later ones are lost.
SOCKET_HOLDS = 277


class Commanded(VirtualTime):
    """A vehicle that somebody commands before a wall, and a guard."""

    guard: Any

    def __init__(self, airframe: str, parameters: dict[str, float] | None, **scene: Any) -> None:
        wall = {"point_ned_m": [FACE_NORTH_M, 0, -2], "normal_ned": [-1, 0, 0], "width_m": 8, "height_m": 20}
        built = Scene.model_validate({"walls": [wall], **scene})
        self.vehicle = SimulatedVehicle(load_built_in(airframe), built, built.seed, parameters=parameters)
        self.events: list[Event] = []
        self.is_late = False  # the guard: what comes waits in its socket
        self._unread: list[bytes] = []
        self._repeated: list[Callable[[], None]] = []
        self.every(1.0, lambda: self.send(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)))

    @property
    def now_us(self) -> int:
        return EPOCH_US + int(self.vehicle.time_boot_us)

    @property
    def state(self) -> State:
        state: State = self.guard.core.state
        return state

    @property
    def mode(self) -> Any:
        return str(self.guard.status().vehicle_mode)

    @abstractmethod
    def send(self, message: Any) -> None:
        """The other's message goes with the next step."""

    def command(self, number: int, *params: float) -> None:
        unset = math.nan if number == TAKEOFF else 0.0
        self.send(dialect.MAVLink_command_long_message(1, 1, number, 0, *params, *[unset] * (7 - len(params))))

    def set_mode(self, main_and_sub: tuple[int, int]) -> None:
        self.command(SET_MODE, 1, *main_and_sub)

    def place(self, north_m: float, east_m: float = 0.0) -> None:
        """At PX4's take-off height, and nothing else."""
        place_ned_m, away = (north_m, east_m, -2.5), [0.0] * 8
        boot_ms = round(1e3 * self.time_s)
        self.send(
            dialect.MAVLink_set_position_target_local_ned_message(boot_ms, 1, 1, 1, PLACE_ONLY, *place_ned_m, *away)
        )

    def every(self, seconds: float, action: Callable[[], None]) -> Callable[[], None]:
        """Do it from now on, again and again; the action returned ends it."""
        due_s = [self.time_s]

        def act() -> None:
            if self.time_s >= due_s[0]:
                due_s[0] = self.time_s + seconds
                action()

        self._repeated.append(act)
        return lambda: self._repeated.remove(act)

    def step(self) -> None:
        for action in tuple(self._repeated):
            action()
        self._exchange()

    @abstractmethod
    def _exchange(self) -> None: ...

    def be_late(self, seconds: float) -> None:
        """The guard gets no turn on its computer for so long."""
        self.is_late = True
        self.run_for(seconds)
        self.is_late = False

    def take_off(self) -> None:
        """By the other's commands: up to PX4's take-off height and hold."""
        self.run_to(State.STANDING_BY, 10.0)
        self.run_for(2.0)
        self.command(ARM, 1)
        self.run_for(0.5)
        self.command(TAKEOFF)
        self.run_to(State.WATCHING, 20.0)
        self.run_for(3.0)


class BetweenFlight(Commanded):
    """The guard is the link; whoever commands comes as clients of it, each by a name."""

    def __init__(
        self, config: GuardConfig | None = None, parameters: dict[str, float] | None = None, **scene: Any
    ) -> None:
        super().__init__("foldable", parameters, **scene)
        between = {"between": ("udpin://127.0.0.1:14540",)}
        self._config = (config or GuardConfig()).model_copy(update=between)
        self._begin()
        self.link = self.vehicle.add_link(LinkKind.ONBOARD)
        self._mavlinks: dict[str, dialect.MAVLink] = {}
        self._reader = dialect.MAVLink(None)
        self.others_last: dict[str, Any] = {}
        self.told_by_clients: list[Any] = []

    def _begin(self) -> None:
        self.guard, self.between = Guard(self._config), Between(2_000_000)
        self._guards: list[bytes] = []
        self._clients: list[tuple[str, bytes]] = []

    def be_restarted(self, after_s: float) -> None:
        """The guard dies, and the link with it; its service manager begins another one."""
        self.be_late(after_s)
        self._unread = []
        self._begin()

    def send(self, message: Any, client: str = "program", source: tuple[int, int] = (255, 190)) -> None:
        mavlink = self._mavlinks.setdefault(client, dialect.MAVLink(None, *source))
        self._clients.append((client, message.pack(mavlink)))
        mavlink.seq = (mavlink.seq + 1) % 256

    def _exchange(self) -> None:
        if not self.is_late:
            self._pass_on()
        self.vehicle.advance()
        self._unread = [*self._unread, *self.link.take()][:SOCKET_HOLDS]
        if not self.is_late:
            received, self._unread = b"".join(self._unread), []
            self._hear(received)

    def _pass_on(self) -> None:
        for client, packet in self._clients:
            self.between.hear(client, packet)
        self._clients = []
        for sender, packets in (("guard", self._guards), ("program", self.between.to_vehicle(self.now_us))):
            for packet in packets:
                self.passes(sender, packet)
                self.link.push(packet)

    def passes(self, sender: str, packet: bytes) -> None:
        """A packet on its way to the vehicle."""

    def _hear(self, received: bytes) -> None:
        heard = self.between.to_clients(received)
        result = self.guard.step(received, self.now_us)
        heard += [packet for packet in result.sent_frames if self.between.sends(packet)]
        self._guards = list(result.sent_frames)
        self.events += result.events
        self.told_by_clients += self.guard.look_at(self.between, self.now_us)
        for packet in heard:
            self.others_heard(self._reader.decode(bytearray(packet)))

    def others_heard(self, message: Any) -> None:
        """The clients."""
        self.others_last[message.get_type()] = message


def by_places(air: BetweenFlight) -> None:
    """Along the first side of a square, which the wall crosses: the place moves on at 1 m/s and waits for nobody."""
    began_s = air.time_s
    air.every(REPEATED_EVERY_S, lambda: air.place(min(air.time_s - began_s, 5.0)))
    air.run_for(0.3)
    air.set_mode(OFFBOARD)


def by_sticks(air: BetweenFlight) -> None:
    sticks(air, 0.3)
    air.run_for(0.2)
    air.set_mode(MANUAL_POSITION)


def sticks(air: BetweenFlight, forward: float) -> Callable[[], None]:
    message = dialect.MAVLink_manual_control_message(1, round(1000 * forward), 0, 500, 0, 0)
    return air.every(0.05, lambda: air.send(message, "pilot", (254, 190)))


def fly_a_mission(air: Any) -> None:
    """One waypoint 8 m north, behind the wall, by the mission protocol; and the mission mode."""
    air.send(dialect.MAVLink_mission_count_message(1, 1, 1, 0))
    air.run_until(lambda: "MISSION_REQUEST_INT" in air.others_last or "MISSION_REQUEST" in air.others_last, 2.0)
    place = air.others_last["GLOBAL_POSITION_INT"]
    north_1e7_deg = round(8.0 / 6_371_000.0 * 1e7 * 180.0 / math.pi)
    air.send(
        dialect.MAVLink_mission_item_int_message(
            *(1, 1, 0, 6, 16, 1, 1, 0.0, 0.0, 0.0, math.nan), place.lat + north_1e7_deg, place.lon, 2.5, 0
        )
    )
    air.run_until(lambda: "MISSION_ACK" in air.others_last, 2.0)
    assert air.others_last["MISSION_ACK"].type == 0
    air.set_mode(MISSION)
