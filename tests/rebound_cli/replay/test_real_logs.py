"""Real flights of real vehicles, where REBOUND_DATA points at them: what they had, and nothing else, is found.

Four healthy flights with ordinary landings, one botched take-off with a hard strike on the ground.
"""

import os
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from companion.messages import ImuSample
from companion.mission.config import CompanionConfig
from rebound_cli.logs.log import LoggedSample
from rebound_cli.logs.reader import read_log
from rebound_cli.main import main
from rebound_cli.replay.report import replay_log
from rebound_cli.replay.watching import watch_log

DATA = os.environ.get("REBOUND_DATA")
pytestmark = pytest.mark.skipif(DATA is None, reason="REBOUND_DATA does not name the folder of real flight logs")

HEALTHY = ("battery_brownout", "corrupt_unregistered", "gps_interference", "mission_rtl")
# A touchdown that a landed vehicle's own peak marks, in seconds after the log's start.
HARD_LANDING_S = {"corrupt_unregistered": 499.86}
STRIKE_S = (2.40, 2.50)
FUSED = CompanionConfig(detector="fused")


@cache
def log_of(name):
    return read_log(Path(DATA) / "px4_logs" / f"{name}.ulg")


def scaled(log, factor):
    """The same flight of a vehicle that shakes, pushes and turns so many times as hard."""
    heard = [
        LoggedSample(
            item.at_us,
            replace(
                item.sample,
                specific_force_frd_m_s2=tuple(factor * value for value in item.sample.specific_force_frd_m_s2),
                angular_velocity_frd_rad_s=tuple(factor * value for value in item.sample.angular_velocity_frd_rad_s),
            ),
        )
        if isinstance(item.sample, ImuSample)
        else item
        for item in log.heard
    ]
    return replace(log, heard=tuple(heard))


@pytest.mark.parametrize("rate_hz", [None, 100.0, 50.0])
@pytest.mark.parametrize("name", HEALTHY)
def test_no_healthy_flight_is_taken_for_a_collision(name, rate_hz):
    assert replay_log(log_of(name), FUSED, rate_hz).findings.collisions == []


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("name", HEALTHY)
def test_nor_with_every_magnitude_halved_or_doubled(name, factor):
    log = log_of(name)
    findings = watch_log(scaled(log, factor), FUSED)
    assert findings.collisions == []
    # A landing that is seen at all is told as one
    at_s = [log.seconds(finding.at_us) for finding in findings.contacts]
    if name in HARD_LANDING_S:
        assert any(abs(moment - HARD_LANDING_S[name]) < 0.05 for moment in at_s)


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_the_strike_on_the_ground_is_found_and_is_no_landing(factor):
    log = log_of("ground_strike")
    found = [log.seconds(finding.at_us) for finding in watch_log(scaled(log, factor), FUSED).collisions]
    assert any(STRIKE_S[0] < at_s < STRIKE_S[1] for at_s in found), found


def test_what_the_logs_are(capsys):
    assert {name: log_of(name).vehicle for name in (*HEALTHY, "ground_strike")} == {
        "battery_brownout": "PX4 1.15.1 on PX4_FMU_V6C",
        "corrupt_unregistered": "PX4 1.17.0 on PX4_FMU_V6XRT",
        "gps_interference": "PX4 1.16.0 on CUAV_7_NANO",
        "mission_rtl": "PX4 1.13.3 on PX4_FMU_V6C",
        "ground_strike": "PX4 1.12.3 on PX4_FMU_V5",
    }
    strike = log_of("ground_strike")
    assert [round(strike.seconds(at_us), 2) for at_us in strike.clipped_at_us] == [2.44, 2.47]
    assert any("no vehicle_attitude before" in loss for loss in strike.losses)
    assert any("damaged" in loss for loss in log_of("corrupt_unregistered").losses)


@pytest.mark.parametrize("name", HEALTHY)
def test_a_script_reads_the_exit_code(name, tmp_path, capsys):
    log = Path(DATA) / "px4_logs" / f"{name}.ulg"
    assert main(["replay", str(log), "--detector", "fused", "--expect", "none", "--out", str(tmp_path)]) == 0
    assert main(["replay", str(log), "--detector", "fused", "--expect", "1", "--out", str(tmp_path)]) == 1


def test_a_log_cut_short_is_read_to_there(tmp_path):
    content = (Path(DATA) / "px4_logs" / "mission_rtl.ulg").read_bytes()
    cut = tmp_path / "cut.ulg"
    cut.write_bytes(content[: len(content) // 2])
    assert 20.0 < read_log(cut).duration_s < 60.0
