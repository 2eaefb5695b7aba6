"""What is said of a computer, from files as Linux writes them."""

from collections import namedtuple

import pytest

from bench.fly.packets import decoded
from companion.mavlink.encode import Encoder
from companion.messages import ComputerStatus
from companion.shell import computer
from companion.shell.computer import ComputerReader

Usage = namedtuple("Usage", "total used free")
GIB = 1 << 30


@pytest.fixture
def linux(tmp_path, monkeypatch):
    """A computer of two cores whose counters a test sets."""
    zone = tmp_path / "sys/class/thermal/thermal_zone"
    for number, millidegrees in enumerate((48_312, 61_200)):
        folder = tmp_path / f"{zone}{number}"
        folder.mkdir(parents=True)
        (folder / "temp").write_text(f"{millidegrees}\n")
    (tmp_path / "proc").mkdir()
    (tmp_path / "proc/uptime").write_text("90.50 170.10\n")
    (tmp_path / "proc/meminfo").write_text(
        "MemTotal: 3883008 kB\nMemFree: 10 kB\nMemAvailable: 3051520 kB\nHugePages: 0\n"
    )
    monkeypatch.setattr(computer.shutil, "disk_usage", lambda _: Usage(30 * GIB, 0, 20 * GIB))
    return tmp_path


def stat(linux, *cores):
    """user, nice, system, idle, iowait, irq, softirq, steal, guest, guest_nice: hundredths of a second."""
    lines = ["cpu  1 2 3 4 5 6 7 8 9 10", *(f"cpu{number} {' '.join(map(str, c))}" for number, c in enumerate(cores))]
    (linux / "proc/stat").write_text("\n".join([*lines, "intr 1 2 3", "ctxt 5"]) + "\n")


def test_memory_disk_temperature_and_time_are_the_systems(linux):
    stat(linux, (0, 0, 0, 100, 0, 0, 0, 0, 0, 0))
    status = ComputerReader(linux, linux).read(1_000)
    assert (status.at_us, status.uptime_ms, status.temperature_deg_c) == (1_000, 90_500, 61)
    # 3883008 and 3051520 kB are 3792 and 2980 MiB; what caches hold is not used
    assert (status.memory_used_mib, status.memory_total_mib) == (812, 3792)
    assert (status.disk_used_mib, status.disk_total_mib) == (10 * 1024, 30 * 1024)


def test_the_load_of_each_core_is_that_since_the_last_reading(linux):
    # Given counters since the start, and a second in which one core did nothing and one waited and worked
    stat(linux, (500, 0, 0, 500, 0, 0, 0, 0, 400, 0), (10, 0, 0, 90, 0, 0, 0, 0, 0, 0))
    reader = ComputerReader(linux, linux)
    first = reader.read(0)
    stat(linux, (500, 0, 0, 590, 10, 0, 0, 0, 400, 0), (20, 5, 10, 130, 10, 3, 2, 20, 0, 0))
    second = reader.read(1_000_000)
    # Then waiting for the disk is no work, and a guest's time counts once
    assert first.cpu_percent == (50, 10)
    assert second.cpu_percent == (0, 50)


def test_a_computer_without_a_sensor_has_no_temperature(linux):
    stat(linux, (0, 0, 0, 100, 0, 0, 0, 0, 0, 0))
    first, second = sorted((linux / "sys/class/thermal").glob("*/temp"))
    second.write_text("unknown")
    assert ComputerReader(linux, linux).read(0).temperature_deg_c == 48
    first.unlink()
    assert ComputerReader(linux, linux).read(0).temperature_deg_c is None


@pytest.mark.parametrize(
    ("cores", "cores_sent"), [((5, 50, 0, 100), [5, 50, 0, 100, *[255] * 4]), (tuple(range(12)), list(range(8)))]
)
@pytest.mark.parametrize(("temperature", "sent"), [(61, 61), (None, 127), (-20, -20), (150, 126), (-300, -128)])
def test_the_message_has_what_is_known_and_fits_and_says_of_the_rest_that_it_is_unused(
    cores, cores_sent, temperature, sent
):
    status = ComputerStatus(1_600_000_000_000_000, 90_500, cores, temperature, 812, 3792, 9_000, 30_000)
    message = decoded(b"".join(Encoder().packets(status)))
    assert message.get_type() == "ONBOARD_COMPUTER_STATUS"
    assert (message.time_usec, message.uptime) == (1_600_000_000_000_000, 90_500)
    assert (message.cpu_cores, message.temperature_board) == (cores_sent, sent)
    assert (message.ram_usage, message.ram_total) == (812, 3792)
    assert message.storage_usage == [9_000, *[0xFFFFFFFF] * 3] and message.storage_total == [30_000, *[0xFFFFFFFF] * 3]
    assert message.temperature_core == [127] * 8 and message.fan_speed == [0x7FFF] * 4
