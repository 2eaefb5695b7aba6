"""`rebound key`, and how a key that cannot be used is refused."""

import hashlib
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from tests.rebound_cli.command import HOP, ROOT, SQUARE, assert_one_clear_sentence, run_here


def test_a_new_key_is_its_owners_alone_random_and_never_shown(tmp_path: Path):
    first, second = tmp_path / "first", tmp_path / "second"
    shown = [run_here("key", "new", file) for file in (first, second)]
    keys = [file.read_text().strip() for file in (first, second)]
    assert keys[0] != keys[1] and all(len(bytes.fromhex(key)) == 32 for key in keys)
    assert {stat.S_IMODE(file.stat().st_mode) for file in (first, second)} == {0o600}
    assert shown[0].returncode == 0 and "MAV_SIGN_CFG = 1" in shown[0].stdout
    assert keys[0] not in shown[0].stdout + shown[0].stderr
    # And it replaces none
    assert_one_clear_sentence(run_here("key", "new", first), first, "exists already")
    assert first.read_text().strip() == keys[0]


def test_a_passphrase_makes_the_key_that_ground_stations_make_of_it(tmp_path: Path):
    command = [sys.executable, "-m", "rebound_cli", "key", "new", str(tmp_path / "key"), "--passphrase"]
    shown = subprocess.run(command, cwd=ROOT, input="correct horse\n", text=True, capture_output=True, timeout=60)
    assert shown.returncode == 0 and "correct horse" not in shown.stdout
    assert (tmp_path / "key").read_text().strip() == hashlib.sha256(b"correct horse").hexdigest()


def test_px4_gets_32_bytes_of_key_and_8_of_time_stamp(tmp_path: Path):
    run_here("key", "new", tmp_path / "key")
    card = tmp_path / "mavlink-signing-key.bin"
    assert run_here("key", "px4", tmp_path / "key", "--card", card).returncode == 0
    assert card.read_bytes() == bytes.fromhex((tmp_path / "key").read_text()) + bytes(8)
    assert stat.S_IMODE(card.stat().st_mode) == 0o600


COMMANDS = {
    "fly": ("fly", SQUARE, *HOP),
    "guard": ("guard",),
    "preflight": ("preflight",),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_key_that_others_may_read_is_refused_before_anything_is_opened_or_written(tmp_path: Path, command):
    key = tmp_path / "key"
    key.write_text("ab" * 32)
    key.chmod(0o644)
    result = run_here(*COMMANDS[command], "--connect", "udpin://127.0.0.1:0", "--signing-key", key)
    assert_one_clear_sentence(result, "mode 644", f"chmod 600 {key}")
    assert "abab" not in result.stderr and list(tmp_path.iterdir()) == [key]
