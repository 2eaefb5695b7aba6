"""A flight with --signing-key against a vehicle that signs as PX4 1.17 does, with and without somebody who forges."""

import hashlib
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mav

from companion.mavlink.signing import Signing as CompanionsSigning
from companion.mavlink.signing import stamp_at
from companion.shell.signing_files import StampFile, write_new
from companion.shell.tlog import read_tlog
from rebound_cli.live.signed_connection import SignedConnection
from rebound_cli.results import run_folder
from sim_vehicle.mavlink.signing import Signing
from sim_vehicle.vehicle import SimulatedVehicle
from tests.rebound_cli.command import assert_comes_again, events_of
from tests.rebound_cli.live.flying import EPOCH_US, World, fly

KEY = hashlib.sha256(b"test").digest()
DISARM = mav.MAVLink_command_long_message(1, 1, 400, 0, 0, 21196, 0, 0, 0, 0, 0)
# Disarmed, and in a mode that a pilot has chosen
STOLEN = mav.MAVLink_heartbeat_message(2, 12, 0x51, 0x30000, 3, 3)
HIT = mav.MAVLink_highres_imu_message(1, -40.0, 0.0, -9.8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x3F)


class SignedWorld(World):
    """Anybody hears both directions, and with `forges` adds packets to both."""

    def __init__(self, scene, forges: bool):
        super().__init__(scene)
        self.vehicle = SimulatedVehicle(
            scene.airframe,
            scene.scene,
            scene.seed,
            parameters={"MAV_SIGN_CFG": 1},
            signing=Signing(KEY),
        )
        self._forges, self._heard, self._count = forges, b"", 0

    def now_us(self):
        return EPOCH_US + self.vehicle.time_boot_us

    def close(self):
        pass

    def _pass(self):
        genuine = super()._pass()
        if not self._forges:
            return genuine
        replayed, self._heard = self._heard, genuine
        self._count += 1
        signs_wrongly = mav.MAVLink(None, 1, 1)
        signs_wrongly.signing.secret_key, signs_wrongly.signing.sign_outgoing = bytes(range(32)), True
        signs_wrongly.signing.timestamp = 2**47 + self._count
        forged = [message.pack(end) for message in (STOLEN, HIT) for end in (mav.MAVLink(None, 1, 1), signs_wrongly)]
        # What the vehicle is sent: of nobody's key, and the companion's last packet once more
        self._pending += DISARM.pack(mav.MAVLink(None, 1, 191)) + b"".join(self.sent[-1:])
        return b"".join(map(bytes, forged)) + replayed + genuine


def flown(folder: Path, forges: bool) -> Any:
    """The world after a flight with the key."""
    folder.mkdir()
    stamps, opened = StampFile(folder / "key"), []

    def signed(world):
        opened.append(SignedConnection(world, CompanionsSigning(KEY, stamps.first(world.now_us())), stamps, world))
        return opened[0]

    _, world, _, _, problem = fly(folder, world_of=lambda scene: SignedWorld(scene, forges), over=signed)
    assert problem is None
    world.refused = opened[0].signing.refused
    opened[0].close()
    return world


def log_of(folder: Path) -> list[bytes]:
    return [packet for _, packet in read_tlog(folder / run_folder.TLOG_NAME)]


def heard(folder: Path) -> list[bytes]:
    return [packet for packet in log_of(folder) if packet[6] == 1]


def setpoints(folder: Path) -> list[bytes]:
    """What they say: sequence numbers go to texts, too."""
    return [packet[10:-2] for packet in log_of(folder) if packet[6:10] == b"\xbf\x54\0\0"]


def decisions(folder: Path) -> list[str]:
    return [event["text"] for event in events_of(folder) if event["kind"] not in ("link", "late")]


@pytest.fixture(scope="module")
def forged_at(tmp_path_factory) -> tuple[Path, Any]:
    """The flight whose every packet comes with forged ones, in both directions: its folder, and the world after it."""
    folder = tmp_path_factory.mktemp("signed") / "loud"
    return folder, flown(folder, forges=True)


def test_forged_and_replayed_packets_on_the_link_change_nothing_of_a_signed_flight(forged_at, tmp_path: Path):
    # Given the flight that nobody disturbs
    quiet = flown(tmp_path / "quiet", forges=False)
    assert decisions(tmp_path / "quiet")[-1] == "done: landed and disarmed, no hit"
    # When every packet comes with forged ones, in both directions
    folder, loud = forged_at
    # Then what was heard, decided and sent is the same to the bit
    assert decisions(folder) == decisions(tmp_path / "quiet")
    for part in (heard, setpoints):
        assert len(part(folder)) > 200 and part(folder) == part(tmp_path / "quiet")
    # And it was counted by both, and told
    assert set(quiet.refused) <= {"old"}
    assert min(loud.refused[reason] for reason in ("unsigned", "forged", "replayed")) > 500
    told = [event["text"] for event in events_of(folder) if event["kind"] == "link"]
    assert any("without a signature are refused" in text for text in told)


def test_a_signed_flights_log_has_no_signature_and_comes_again_without_the_key(forged_at):
    folder, _ = forged_at
    packets = log_of(folder)
    assert len(packets) > 2000 and not any(packet[2] for packet in packets)
    assert_comes_again(folder)
    for file in folder.iterdir():
        content = file.read_bytes()
        assert KEY not in content and KEY.hex().encode() not in content


def test_what_was_recorded_before_a_restart_is_not_heard_after_it(tmp_path: Path):
    # Given a session whose packets somebody recorded, and a clock that is a day behind after the restart
    key_file, now_us = tmp_path / "key", 1_700_000_000_000_000
    write_new(key_file, KEY.hex().encode())
    vehicle = mav.MAVLink(None, 1, 1)
    vehicle.signing.secret_key, vehicle.signing.sign_outgoing = KEY, True
    vehicle.signing.timestamp = stamp_at(now_us)
    recorded = [bytes(STOLEN.pack(vehicle)) for _ in range(20)]
    first = Line([b"".join(recorded)], now_us)
    before = session(key_file, first)
    assert before.receive(1.0) and before.signing.refused == {}
    before.close()
    # When they are played again
    again = Line([b"".join(recorded)], now_us - 86_400_000_000)
    after = session(key_file, again)
    # Then none is heard, and what is sent is later than all before
    assert after.receive(1.0) == b"" and after.signing.refused == {"old": 20}
    for connection in (before, after):
        connection.send(bytes(STOLEN.pack(mav.MAVLink(None, 1, 191))))
    assert first.stamps() < again.stamps()
    after.close()


class Line:
    """A link on which datagrams wait, and the clock."""

    def __init__(self, waiting: list[bytes], time_us: int):
        self._waiting, self.time_us, self._sent = waiting, time_us, []

    def now_us(self) -> int:
        return self.time_us

    def receive(self, timeout_s: float) -> bytes:
        return self._waiting.pop(0) if self._waiting else b""

    def send(self, frame: bytes) -> None:
        self._sent.append(frame)

    def news(self) -> None:
        return None

    def close(self) -> None:
        return None

    def stamps(self) -> list[int]:
        return [int.from_bytes(packet[-12:-6], "little") for packet in self._sent]


def session(key_file: Path, line: Any) -> SignedConnection:
    stamps = StampFile(key_file)
    return SignedConnection(line, CompanionsSigning(KEY, stamps.first(line.now_us())), stamps, line)


@pytest.mark.parametrize("reason", ["unsigned", "forged"])
def test_a_flood_that_is_refused_does_not_wake_the_loop_for_each_packet(tmp_path: Path, reason):
    # Given a datagram a packet, three hundred of them, before one that is genuine
    end, now_us = mav.MAVLink(None, 1, 1), 1_700_000_000_000_000
    end.signing.timestamp = stamp_at(now_us)
    if reason == "forged":
        end.signing.secret_key, end.signing.sign_outgoing = bytes(range(32)), True
    waiting = [bytes(STOLEN.pack(end)) for _ in range(299)]
    end.signing.secret_key, end.signing.sign_outgoing = KEY, True
    line = Line([*waiting, bytes(STOLEN.pack(end))], now_us)
    connection = session(tmp_path / "key", line)
    assert connection.receive(0.0) == bytes(STOLEN.pack(mav.MAVLink(None, 1, 1)))
    assert connection.signing.refused == {reason: 299}
    connection.close()
