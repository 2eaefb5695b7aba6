"""`--signing-key` on real sockets: `rebound sim` as PX4 1.17, and somebody who sends to both of its ends."""

import json
import re
import socket
import threading
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import development as mav

from tests.rebound_cli.command import HOP, SQUARE, assert_comes_again, events_of, run, vehicle_on_air

pytestmark = pytest.mark.realtime

STOLEN = bytes(mav.MAVLink_heartbeat_message(2, 12, 0x51, 0x30000, 3, 3).pack(mav.MAVLink(None, 1, 1)))
HIT = mav.MAVLink_highres_imu_message(1, -40.0, 0.0, -9.8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x3F)


@pytest.fixture
def signed(tmp_path: Path):
    """The key, a port for the companion, and a vehicle that has the key."""
    key = tmp_path / "key"
    assert run("key", "new", key).returncode == 0
    with vehicle_on_air("--signing-key", key) as port:
        yield key, port


@pytest.fixture
def attacker(signed):
    """Sends to the companion's port from before it is open until the end."""
    _, port = signed
    over = threading.Event()
    hit = bytes(HIT.pack(mav.MAVLink(None, 1, 1)))

    def attack() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            while not over.wait(0.005):
                for packet in (STOLEN, hit, b"\0", hit[:20]):
                    sender.sendto(packet, ("127.0.0.1", port))

    thread = threading.Thread(target=attack)
    thread.start()
    yield
    over.set()
    thread.join()


@pytest.mark.usefixtures("attacker")
def test_a_signed_flight_ends_well_whoever_else_sends_to_its_port(signed, tmp_path: Path):
    key, port = signed
    folder = tmp_path / "run"
    flown = run(
        "fly", SQUARE, "--connect", f"udpin://127.0.0.1:{port}", "--signing-key", key, "--yes", "--out", folder, *HOP
    )
    summary = json.loads((folder / "summary.json").read_text())
    assert flown.returncode == 0, flown.stdout + flown.stderr
    assert (summary["outcome"], summary["collisions"], summary["unconfirmed"]) == ("completed", [], 0)
    assert {event["kind"] for event in events_of(folder)} & {"detection", "implausible", "aborted"} == set()
    assert_comes_again(folder)
    assert re.fullmatch(r"\d+\n", (tmp_path / "key.stamp").read_text())


def test_who_has_another_key_hears_nobody_and_is_told_why(signed, tmp_path: Path):
    _, port = signed
    other = tmp_path / "other"
    run("key", "new", other)
    address, folder = f"udpin://127.0.0.1:{port}", tmp_path / "run"
    flown = run("fly", SQUARE, "--connect", address, "--signing-key", other, "--yes", "--out", folder, *HOP)
    assert flown.returncode == 1 and "signed with another key" in " ".join(flown.stdout.split())
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["refused_packets"]["forged"] > 500
