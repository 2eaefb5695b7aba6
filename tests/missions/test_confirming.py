"""One packet alone is answered at once and counts for nothing: a second row confirms a hit within 150 ms."""

import functools
import json
import math
import os
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mav

from bench.fly.packets import ODOMETRY, POSITION, changed
from companion.companion import Companion
from companion.mavlink.packet import message_id_of
from companion.report import Event
from rebound_cli.documents import apply_overrides, parse_document
from rebound_cli.inputs import mission_from, world_from
from sim_vehicle.vehicle import SimulatedVehicle

pytestmark = pytest.mark.flight

EPOCH_US = 1_600_000_000_000_000
AXES = ("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro")
MISSION = """\
name: forged
items:
  - takeoff: {height_m: 1.5}
  - go_to: {position_ned_m: [6, 0, -1.5], speed_m_s: 2.0}
  - land: {}
on_collision: {then: continue, max_hits: 2}
companion: {streams: {window_s: 0.5}}
sim: {walls: []}
"""


@dataclass
class Air:
    """Companion and simulated vehicle in lockstep, and somebody who sends in the vehicle's name."""

    sets: tuple[str, ...] = ()
    events: list[Event] = field(default_factory=list)
    pending: bytes = b""
    heard: bytes = b""
    setpoints: list = field(default_factory=list)

    def __post_init__(self) -> None:
        document = parse_document(MISSION, "forged.yaml")
        apply_overrides(document, self.sets)
        world = world_from(document)
        self.companion = Companion(mission_from(document, world))
        self.companion.confirm_plan()
        self.vehicle = SimulatedVehicle(world.airframe, world.scene, world.seed)

    @property
    def state(self) -> str:
        return self.companion.status().state

    def step(self, forged: bytes = b"", pilots: bytes = b"") -> None:
        """`forged` reaches the companion before the vehicle's packets, `pilots` the vehicle after the companion's."""
        self.heard = b"".join(self.vehicle.step(self.pending + pilots))
        result = self.companion.step(forged + self.heard, EPOCH_US + self.vehicle.time_boot_us)
        self.pending = b"".join(result.sent_frames)
        self.events += result.events
        for frame in result.sent_frames:
            message = mav.MAVLink(None).decode(bytearray(frame))
            if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
                self.setpoints.append(message)

    def run_until(self, condition, limit_s=60.0) -> None:
        for _ in range(round(limit_s * 250)):
            if condition():
                return
            self.step()
        raise AssertionError([event.text for event in self.events])

    def imu(self, force_m_s2: float, rate_rad_s: float = 0.0) -> bytes:
        """Between two of its own samples: a push against the way, or a turn about the nose."""
        values = (force_m_s2, 0, -9.8, rate_rad_s, 0, 0, 0, 0, 0, 0, 0, 0, 0)
        return packed(mav.MAVLink_highres_imu_message(self.vehicle.time_boot_us + 2000, *values, 0x3F))

    def motion(self) -> tuple[float, ...]:
        """Place and velocity as the vehicle last told them."""
        latest = self.companion.core.flight.vehicle.history.latest()
        return (*latest.position_ned_m, *latest.velocity_ned_m_s)

    def local_position(self, *jump: float) -> bytes:
        moved = [was + by for was, by in zip(self.motion(), jump, strict=True)]
        return packed(mav.MAVLink_local_position_ned_message((self.vehicle.time_boot_us + 2000) // 1000, *moved))

    def odometry(self, *jump: float) -> bytes:
        """With the reset counter of a vehicle that has never reset its estimate."""
        x, y, z, *velocity = (was + by for was, by in zip(self.motion(), jump, strict=True))
        unknown = [math.nan] * 21
        values = (1, 1, x, y, z, [1, 0, 0, 0], *velocity, 0, 0, 0, unknown, unknown, 0)
        return packed(mav.MAVLink_odometry_message(self.vehicle.time_boot_us + 2000, *values))

    def spoil_imu(self, spoilt: Callable[[tuple[float, ...]], tuple[float, ...]], seconds: float) -> None:
        """Let the vehicle's IMU read otherwise for a while: its three forces and three rates."""
        fly, until_us = self.vehicle.step, self.vehicle.time_boot_us + round(seconds * 1e6)

        def step(received: bytes) -> list[bytes]:
            heard = []
            for frame in fly(received):
                message = mav.MAVLink(None).decode(bytearray(frame))
                if message.get_type() == "HIGHRES_IMU" and self.vehicle.time_boot_us < until_us:
                    values = spoilt(tuple(getattr(message, axis) for axis in AXES))
                    frame = packed(mav.MAVLink_highres_imu_message(message.time_usec, *values, *[0] * 7, 0x3F))
                heard.append(frame)
            return heard

        self.vehicle.step = step

    def move_places(self, by_m: float, seconds: float) -> None:
        """Let the vehicle say for a while that it is so far north of where it is; no reset is counted."""
        fly, until_us = self.vehicle.step, self.vehicle.time_boot_us + round(seconds * 1e6)

        def move(message: mav.MAVLink_message) -> None:
            message.x += by_m

        def step(received: bytes) -> list[bytes]:
            is_on = self.vehicle.time_boot_us < until_us
            kinds = (POSITION, ODOMETRY) if is_on else ()
            return [changed(f, move) if message_id_of(f) in kinds else f for f in fly(received)]

        self.vehicle.step = step


def packed(message: mav.MAVLink_message) -> bytes:
    return bytes(message.pack(mav.MAVLink(None, 1, 1)))


def in_a_child(work: Callable[[], Any]) -> Any:
    """What becomes of this instant, in a copy of the process: a simulated vehicle cannot be copied alone."""
    reads, writes = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reads)
        try:
            found = work()
        except BaseException:
            found = {"error": traceback.format_exc()}
        os.write(writes, json.dumps(found).encode())
        os._exit(0)
    os.close(writes)
    with os.fdopen(reads) as pipe:
        text = pipe.read()
    os.waitpid(child, 0)
    return json.loads(text)


@functools.cache
def cruising(*sets: str) -> Air:
    """Flown once, and looked at in children alone."""
    air = Air(sets)
    air.run_until(lambda: air.state == "mission" and (air.companion.status().position_ned_m or (0,))[0] > 2.5)
    return air


def fly_on(work: Callable[[Air], None], *sets: str) -> None:
    """What the test does with a vehicle in the middle of its cruise."""
    air = cruising(*sets)
    found = in_a_child(lambda: work(air))
    assert found is None, found["error"]


def assert_goes_on(air: Air, unconfirmed: int) -> None:
    """To the item's goal, as if nothing had been there."""
    air.run_until(lambda: air.state == "landing", 4.0)
    assert air.motion()[0] == pytest.approx(6.0, abs=0.3)
    report = air.companion.report()
    assert (report.collisions, report.unconfirmed, report.obstacles) == ((), unconfirmed, ())


@pytest.mark.parametrize("force_m_s2", [-100.0, -40.0, -10.0, -5.0, 40.0])
def test_one_forged_packet_costs_a_twitch(force_m_s2):
    def forge(air: Air) -> None:
        before = len(air.setpoints)
        air.step(air.imu(force_m_s2))
        # The companion acts on it at once
        assert air.state == "recovering"
        began_us, here = air.vehicle.time_boot_us, air.companion.status().position_ned_m
        air.run_until(lambda: air.state != "recovering", 1.0)
        # And within a quarter of a second the mission goes on
        assert air.state == "mission" and air.vehicle.time_boot_us - began_us <= 250_000
        assert [event.kind for event in air.events].count("unconfirmed") == 1
        for message in air.setpoints[before:]:
            if not message.type_mask & 0x003:
                assert math.dist((message.x, message.y, message.z), here) <= 5.0
            if not message.type_mask & 0x1C0:
                assert math.hypot(message.afx, message.afy) <= 9.81
        assert_goes_on(air, unconfirmed=1)

    fly_on(forge)


@pytest.mark.parametrize("hz", [250, 50])
@pytest.mark.parametrize(
    "forged",
    [lambda air: air.odometry(0, 0, 0, -2, 0, 0), lambda air: air.odometry(0, 0, 0, 0, 2, 0)],
    ids=["brakes", "slides"],
)
def test_one_forged_velocity_is_contradicted_by_the_velocities_after_it(forged, hz):
    def forge(air: Air) -> None:
        began_us = air.vehicle.time_boot_us
        air.step(forged(air))
        air.run_until(lambda: air.state == "recovering", 0.1)
        air.run_until(lambda: air.state == "mission", 1.0)
        assert air.vehicle.time_boot_us - began_us <= 250_000
        # What was none hides nothing of a velocity
        air.run_until(lambda: air.events[-1].text == "velocity valid again", 0.1)
        assert_goes_on(air, unconfirmed=1)

    fly_on(forge, f"companion.streams.highres_imu_hz={hz}")


@pytest.mark.parametrize("hz", [250, 50])
@pytest.mark.parametrize("rate_rad_s", [10.0, 30.0])
def test_one_forged_rate_is_no_hit(rate_rad_s, hz):
    def forge(air: Air) -> None:
        air.step(air.imu(0.0, rate_rad_s=rate_rad_s))
        assert_goes_on(air, unconfirmed=0)

    fly_on(forge, f"companion.streams.highres_imu_hz={hz}")


@pytest.mark.parametrize(
    "jump",
    [(5, 0, 0, 0, 0, 0), (0, -5, 0, 0, 0, 0), (0, 0, 5, 0, 0, 0), (0, 0, 0, -2, 0, 0), (0, 0, 0, 0, 2, 0)],
)
def test_one_forged_position_or_velocity_of_local_position_is_no_hit(jump):
    def forge(air: Air) -> None:
        air.step(air.local_position(*jump))
        assert_goes_on(air, unconfirmed=0)

    fly_on(forge)


def stuck() -> Callable[[tuple[float, ...]], tuple[float, ...]]:
    """All six at the values they first show."""
    first: list[tuple[float, ...]] = []

    def spoilt(values: tuple[float, ...]) -> tuple[float, ...]:
        first.append(values)
        return first[0]

    return spoilt


@pytest.mark.parametrize(
    ("spoilt", "reason"),
    [
        (stuck, "detector blind: IMU stuck at one value"),
        (lambda: lambda _: (0.0,) * 6, "detector blind: HIGHRES_IMU not accepted: the accelerometer reads zero"),
    ],
    ids=["stuck", "zero"],
)
@pytest.mark.parametrize("north_m", [2.5, 5.2])
def test_an_imu_that_measures_nothing_for_a_second_makes_the_detector_blind_and_is_no_hit(spoilt, reason, north_m):
    """In cruise, and where the vehicle brakes for its goal, which such a sensor does not show."""

    def spoil(air: Air) -> None:
        air.run_until(lambda: air.motion()[0] > north_m)
        air.spoil_imu(spoilt(), seconds=1.0)
        for _ in range(500):
            air.step()
        links = [event.text for event in air.events if event.kind == "link"]
        assert len(links) == 2 and links[0].startswith(reason) and links[1] == "the detector sees again"
        report = air.companion.report()
        assert (report.collisions, report.unconfirmed) == ((), 0)

    fly_on(spoil)


def test_places_that_are_not_believed_for_half_a_second_are_no_lean_on_an_obstacle_of_half_a_second():
    # Given a vehicle that speeds up, when its places jump by 50 m until no velocity speaks against them any more
    air = Air()
    air.run_until(lambda: air.state == "mission" and air.motion()[0] > 1.0)
    air.move_places(50.0, seconds=1.0)
    air.run_until(lambda: air.companion.finished, 1.5)
    # Then it is handed over for being out of its fence, and nothing was in its way
    report = air.companion.report()
    assert "outside the fence" in report.reason
    assert (report.collisions, report.obstacles) == ((), ())


def test_the_hits_allowed_are_not_used_up_by_hits_that_were_none():
    def forge(air: Air) -> None:
        for _ in range(3):
            air.step(air.imu(-40.0))
            air.run_until(lambda: air.state == "mission")
            for _ in range(150):  # what the velocity was is taken from half a second
                air.step()
        air.run_until(lambda: air.companion.finished)
        assert air.companion.report().unconfirmed == 3
        assert air.companion.report().outcome == "completed"
        assert "policy" not in [event.kind for event in air.events]

    fly_on(forge)


@pytest.mark.parametrize("airframe", ["foldable", "rigid"])
@pytest.mark.parametrize("hz", [250, 50])
def test_a_hit_on_a_wall_is_confirmed(airframe, hz):
    """By the velocity, where one sample alone shows the contact."""
    wall = "sim.walls=[{point_ned_m: [4, 0, 0], normal_ned: [-1, 0, 0]}]"
    rate = f"companion.streams.highres_imu_hz={hz}"
    air = Air((wall, rate, f"sim.airframe={airframe}"))
    air.run_until(lambda: air.state == "recovering")
    for _ in range(250):
        air.step()
    assert air.companion.report().unconfirmed == 0 and len(air.companion.report().collisions) >= 1
