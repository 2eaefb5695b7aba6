"""A scripted vehicle on the wire: PX4's packets made with pymavlink, obedient point-mass motion, one wall.

It shares no code with the product. What it does on request can be spoiled in the ways a link or a vehicle can
spoil it: silence, refusals, lost answers, a pilot, a failsafe.
"""

import copyreg
import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from pymavlink.dialects.v20 import development as mav

from bench.fly.virtual_time import INTERVAL_US
from companion.companion import Companion
from companion.mission.model import Mission
from tests.flying import Flight

# A layout of bytes knows no copying, and is made anew.
copyreg.pickle(struct.Struct, lambda layout: (struct.Struct, (layout.format,)))

OFFBOARD, LOITER, LAND, POSCTL = 6 << 16, 4 << 16 | 3 << 24, 4 << 16 | 6 << 24, 3 << 16

TAKEOFF, LANDING = {"takeoff": {"height_m": 1.5}}, {"land": {}}
INTO_WALL = {"go_to": {"position_ned_m": [5, 0, -1.5], "speed_m_s": 2.0}}
SQUARE_ITEMS = [
    TAKEOFF,
    {"go_to": {"position_ned_m": [3, 0, -1.5], "speed_m_s": 2.0}},
    {"hold": {"duration_s": 0.5}},
    {"go_to": {"position_ned_m": [0, 2, -1.5], "speed_m_s": 2.0, "yaw_deg": 90}},
    LANDING,
]


def mission(companion: dict | None = None, **changes: Any) -> Mission:
    """Measures the streams for half a second instead of two, unless told otherwise."""
    settings = {"streams": {"window_s": 0.5}, **(companion or {})}
    return Mission.model_validate({"name": "test", "items": SQUARE_ITEMS, "companion": settings, **changes})


@dataclass
class FakeVehicle:
    """Everything scripted is a public field, to be changed at any time."""

    system_id: int = 1
    autopilot: int = 12
    vehicle_type: int = 2
    imu_every: int = 1  # intervals between HIGHRES_IMU
    silent: bool = False
    deaf: bool = False  # hears nothing, keeps talking
    no_positions: bool = False
    battery_percent: int | None = None
    no_imu: bool = False
    no_current_mode: bool = False
    ack: Callable[[int, int], list[int]] = lambda command, count: [0]  # (command, how often) -> results
    obey: Callable[[int, int], bool] = lambda command, count: True
    wall_north_m: float | None = None
    restitution_spring: tuple[float, float] = (30.0, 500.0)  # b_s, k_s of eq. 2
    start_ned_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    time_us: int = 5_000_000
    yaw_rad: float = 0.0
    yaw_rate_rad_s: float = 0.0
    roll_rad: float = 0.0
    mode: int = LOITER
    intended: int = LOITER
    armed: bool = False
    failsafe: bool = False
    landed: int = 1
    touching: bool = False
    push_m_s2: tuple[float, float] = (0.0, 0.0)  # scripted lateral force of the next sample, body x and y
    setpoints: list = field(default_factory=list)  # (time_us, message)
    commands: list = field(default_factory=list)
    heartbeats: list = field(default_factory=list)
    timesyncs: list = field(default_factory=list)
    asked: list = field(default_factory=list)
    round_trip_us: int = 0  # after which it answers TIMESYNC; one interval at least
    does_answer_time: bool = True
    loss_s: float = 1.0  # COM_OF_LOSS_T
    lost_answers: int = 0  # to the first so many questions for it
    contact_times_us: list = field(default_factory=list)

    def __post_init__(self) -> None:
        self.position = list(self.start_ned_m)
        self.velocity = [0.0, 0.0, 0.0]
        self.specific_force = [0.0, 0.0, -9.81]
        self.target = None
        self.counts: dict[int, int] = {}
        self.ticks = 0
        self.tx = mav.MAVLink(None, self.system_id, 1)
        self.rx = mav.MAVLink(None)
        self.rx.robust_parsing = True
        self.out = b""

    # --- what others do to the vehicle

    def pilot_takes(self, mode: int) -> None:
        self.mode = self.intended = mode

    def failsafe_takes(self, mode: int) -> None:
        self.mode, self.failsafe = mode, True

    # --- the wire

    def step(self, received: bytes) -> bytes:
        if not self.deaf:
            for message in self.rx.parse_buffer(received) or []:
                self.hear(message)
        self.move()
        self.ticks += 1
        self.time_us += INTERVAL_US
        self.stream()
        sent, self.out = self.out, b""
        return b"" if self.silent else sent

    def send(self, message) -> None:
        self.out += bytes(message.pack(self.tx))
        self.tx.seq = (self.tx.seq + 1) % 256

    def hear(self, message) -> None:
        kind = message.get_type()
        if kind == "SET_POSITION_TARGET_LOCAL_NED":
            self.setpoints.append((self.time_us, message))
            self.target = message
        elif kind == "HEARTBEAT":
            self.heartbeats.append((self.time_us, message))
        elif kind == "TIMESYNC":
            if message.tc1 == 0:
                self.asked.append((self.time_us + self.round_trip_us, message.ts1))
            else:
                self.timesyncs.append(message)
        elif kind == "PARAM_REQUEST_READ" and message.param_id == "COM_OF_LOSS_T":
            self.lost_answers -= 1
            if self.lost_answers < 0:
                kind_of_number = mav.MAV_PARAM_TYPE_REAL32
                self.send(mav.MAVLink_param_value_message(b"COM_OF_LOSS_T", self.loss_s, kind_of_number, 1, 0))
        elif kind == "COMMAND_LONG":
            self.obey_command(message)

    def obey_command(self, message) -> None:
        command = message.command
        self.commands.append((self.time_us, message))
        self.counts[command] = count = self.counts.get(command, 0) + 1
        for result in self.ack(command, count):
            self.send(mav.MAVLink_command_ack_message(command, result, 0, 0, 1, 191))
        if not self.obey(command, count):
            return
        if command == 176:
            self.mode = self.intended = int(message.param2) << 16 | int(message.param3) << 24
        elif command == 400:
            self.armed = message.param1 == 1.0
        elif command == 512 and message.param1 == 148:
            self.send(mav.MAVLink_autopilot_version_message(0, 1 << 24 | 15 << 16, 0, 0, 0, *[[0] * 8] * 3, 0, 0, 0))

    def stream(self) -> None:
        n, boot_ms = self.ticks, self.time_us // 1000
        if n % self.imu_every == 0 and not self.no_imu:
            (x, y, z), push, self.push_m_s2 = self.specific_force, self.push_m_s2, (0.0, 0.0)
            measured = (x + push[0], y + push[1], z, 0.0, 0.0, self.yaw_rate_rad_s)
            self.send(mav.MAVLink_highres_imu_message(self.time_us, *measured, *[0] * 7, 0x3F))
        if n % 5 == 0 and not self.no_positions:
            self.send(mav.MAVLink_local_position_ned_message(boot_ms, *self.position, *self.velocity))
        if n % 5 == 1:
            (c, s), (d, r) = ((math.cos(0.5 * a), math.sin(0.5 * a)) for a in (self.yaw_rad, self.roll_rad))
            self.send(mav.MAVLink_attitude_quaternion_message(boot_ms, c * d, c * r, s * r, s * d, 0.0, 0.0, 0.0))
        if n % 25 == 2 and not self.no_current_mode:
            self.send(mav.MAVLink_current_mode_message(0, self.mode, self.intended))
        if n % 50 == 3:
            self.send(mav.MAVLink_extended_sys_state_message(0, self.landed))
        if n % 250 == 4:
            status = 5 if self.failsafe else 4 if self.armed else 3
            base = 0x1D | (0x80 if self.armed else 0)
            self.send(mav.MAVLink_heartbeat_message(self.vehicle_type, self.autopilot, base, self.mode, status, 3))
        if n % 50 == 6 and self.battery_percent is not None:
            self.send(mav.MAVLink_sys_status_message(0, 0, 0, 300, 15_000, 900, self.battery_percent, 0, 0, 0, 0, 0, 0))
        while self.does_answer_time and self.asked and self.asked[0][0] <= self.time_us:
            self.send(mav.MAVLink_timesync_message(self.time_us * 1000, self.asked.pop(0)[1]))
        if n % 25 == 5:
            self.send(mav.MAVLink_timesync_message(0, self.time_us * 1000))

    # --- motion

    def move(self) -> None:
        dt = INTERVAL_US * 1e-6
        command, self.yaw_rate_rad_s = [0.0, 0.0, 0.0], 0.0
        if self.armed and self.mode == OFFBOARD and self.target is not None:
            t = self.target
            if not t.type_mask & 0x400:
                self.yaw_rate_rad_s = 2.8 * math.remainder(t.yaw - self.yaw_rad, math.tau)
                self.yaw_rad += self.yaw_rate_rad_s * dt
            acceleration_only = t.type_mask & 0x007
            ahead = self.position if acceleration_only else [t.x, t.y, t.z]
            forward = [0.0, 0.0, 0.0] if t.type_mask & 0x038 else [t.vx, t.vy, t.vz]
            command = [forward[i] + 2.0 * (ahead[i] - self.position[i]) for i in range(3)]
            if acceleration_only:
                command = [v + a / 6.0 for v, a in zip(self.velocity, [t.afx, t.afy, t.afz], strict=True)]
            if self.landed == 1 and ahead[2] > self.start_ned_m[2] - 0.05:
                command = [0.0, 0.0, 0.0]  # feet do not slide
        elif self.armed and self.mode == LAND:
            command = [0.0, 0.0, 0.7]
        # The spring of a contact needs 0.1 ms; free flight is a lag of 1/6 s.
        steps = 40 if self.wall_north_m is not None and self.position[0] > self.wall_north_m - 0.1 else 1
        force, h = 0.0, dt / steps
        # It is always level: of what its motors do to it the accelerometer shows no more than looks like no contact.
        driven = max(-0.8, min(0.8, 6.0 * (command[0] - self.velocity[0])))
        for _ in range(steps):
            for i in range(3):
                self.velocity[i] += max(-8.0, min(8.0, 6.0 * (command[i] - self.velocity[i]))) * h
            force += self.wall_force(h) / steps
            for i in range(3):
                self.position[i] += self.velocity[i] * h
        self.specific_force = [force + driven, 0.0, -9.81]
        self.meet_ground()

    def wall_force(self, h: float) -> float:
        """Eq. 2: the wall pushes, and never pulls; returns the specific force along north."""
        if self.wall_north_m is None:
            return 0.0
        fold = self.position[0] - self.wall_north_m
        if fold <= 0.0:
            self.touching = False
            return 0.0
        b, k = self.restitution_spring
        push = -(b * self.velocity[0] + k * fold)
        if push >= 0.0:
            return 0.0
        if not self.touching:
            self.touching = True
            self.contact_times_us.append(self.time_us)
        self.velocity[0] += push * h
        return push

    def meet_ground(self) -> None:
        if self.position[2] >= self.start_ned_m[2]:
            self.position[2] = self.start_ned_m[2]
            self.velocity[2] = min(0.0, self.velocity[2])
            if self.mode == LAND and self.armed and self.landed != 1:
                self.landed, self.armed = 1, False
        elif self.start_ned_m[2] - self.position[2] > 0.1:
            self.landed = 2


def flying_in(state: str, **changes: Any) -> Flight:
    """A flight in the middle of the given state; of a mission that meets a wall 3 m north, and goes home."""
    return _flying_in(state, **changes).copy()


@cache
def _flying_in(state: str, **changes: Any) -> Flight:
    vehicle = FakeVehicle(wall_north_m=3.0, battery_percent=80)
    f = flight(vehicle, items=[TAKEOFF, INTO_WALL, {"return": {}}], **changes)
    if state == "takeoff":
        f.run_until(lambda: f.vehicle.landed == 2)
    elif state == "landing":
        f.run_until(lambda: "landing" in f.kinds())
    else:
        f.run_to(state)
    f.run_for(0.1)
    assert f.state == state
    return f


def flight(vehicle: FakeVehicle | None = None, confirmed: bool = True, **changes: Any) -> Flight:
    companion = Companion(mission(**changes))
    if confirmed:
        companion.confirm_plan()
    return Flight(companion, vehicle or FakeVehicle())


def hovering(vehicle: FakeVehicle | None = None, **changes: Any) -> Flight:
    """A second after a take-off, in a hold that lasts longer than a test."""
    f = flight(vehicle, items=[TAKEOFF, {"hold": {"duration_s": 60}}, LANDING], **changes)
    f.run_to("mission")
    f.run_for(1.0)
    return f


def strike(f: Flight, x_m_s2: float = 12.0, y_m_s2: float = 0.0) -> None:
    """Something pushes the vehicle's body for a few IMU samples."""
    for _ in range(3):
        f.vehicle.push_m_s2 = (x_m_s2, y_m_s2)
        f.step()


def at_wall(*items: Any, **changes: Any) -> Flight:
    """Up, through these items, and down; a wall stands 3 m north."""
    return flight(FakeVehicle(wall_north_m=3.0), items=[TAKEOFF, *items, LANDING], **changes)
