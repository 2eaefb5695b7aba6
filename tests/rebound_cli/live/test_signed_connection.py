"""The connection of --signing-key: what is not genuine is not heard, after a restart neither."""

import hashlib
import itertools
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from pymavlink.dialects.v20 import development as mav

from companion.mavlink.signing import Signing, stamp_at
from companion.shell.signing_files import StampFile, write_new
from rebound_cli.live.signed_connection import SignedConnection

KEY = hashlib.sha256(b"test").digest()
# Disarmed, and in a mode that a pilot has chosen
STOLEN = mav.MAVLink_heartbeat_message(2, 12, 0x51, 0x30000, 3, 3)


def test_what_was_recorded_before_a_restart_is_not_heard_after_it(tmp_path: Path):
    # Given a session whose packets somebody recorded, and a clock that is a day behind after the restart
    key_file, now_us = tmp_path / "key", 1_700_000_000_000_000
    write_new(key_file, KEY.hex().encode())
    vehicle = mav.MAVLink(None, 1, 1)
    vehicle.signing.secret_key, vehicle.signing.sign_outgoing = KEY, True
    vehicle.signing.timestamp = stamp_at(now_us)
    recorded = [bytes(STOLEN.pack(vehicle)) for _ in range(20)]
    first = line_with([b"".join(recorded)], now_us)
    before = session(key_file, first)
    assert before.receive(1.0) and before.signing.refused == {}
    before.close()
    # When they are played again
    again = line_with([b"".join(recorded)], now_us - 86_400_000_000)
    after = session(key_file, again)
    # Then none is heard, and what is sent is later than all before
    assert after.receive(1.0) == b"" and after.signing.refused == {"old": 20}
    for connection in (before, after):
        connection.send(bytes(STOLEN.pack(mav.MAVLink(None, 1, 191))))
    assert stamps_on(first) < stamps_on(again)
    after.close()


def line_with(waiting: list[bytes], time_us: int) -> Mock:
    """A link on which datagrams wait, and a clock that goes on by 4 ms each time it is read."""
    receive = Mock(side_effect=itertools.chain(waiting, itertools.repeat(b"")))
    return Mock(receive=receive, now_us=itertools.count(time_us, 4_000).__next__, news=lambda: None)


def stamps_on(line: Mock) -> list[int]:
    return [int.from_bytes(call.args[0][-12:-6], "little") for call in line.send.call_args_list]


def session(key_file: Path, line: Any) -> SignedConnection:
    stamps = StampFile(key_file)
    return SignedConnection(line, Signing(KEY, stamps.first(line.now_us())), stamps, line)


@pytest.mark.parametrize("reason", ["unsigned", "forged"])
def test_a_flood_that_is_refused_does_not_wake_the_loop_for_each_packet(tmp_path: Path, reason):
    # Given a datagram a packet, three hundred of them, before one that is genuine
    end, now_us = mav.MAVLink(None, 1, 1), 1_700_000_000_000_000
    end.signing.timestamp = stamp_at(now_us)
    if reason == "forged":
        end.signing.secret_key, end.signing.sign_outgoing = bytes(range(32)), True
    waiting = [bytes(STOLEN.pack(end)) for _ in range(299)]
    end.signing.secret_key, end.signing.sign_outgoing = KEY, True
    line = line_with([*waiting, bytes(STOLEN.pack(end))], now_us)
    connection = session(tmp_path / "key", line)
    assert connection.receive(0.0) == bytes(STOLEN.pack(mav.MAVLink(None, 1, 1)))
    assert connection.signing.refused == {reason: 299}
    # And it is told, once it has lasted
    assert "so far, the last HEARTBEAT of system 1" in connection.news()
    connection.close()
