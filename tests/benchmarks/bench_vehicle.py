"""`rebound sim` as a tool: `python -m tests.benchmarks.bench_vehicle [start|many|hour]`. Nothing here passes or fails.

Prints, of what is named (without a name: all of it): how long it takes from the process's start to the first HEARTBEAT
on its socket and to `rebound --help`, with compiled kernels at hand; how eight vehicles keep real time on one machine;
and how the memory of a flight of an hour in lockstep grows.
"""

import resource
import socket
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.airframe import load_built_in
from sim_vehicle.mavlink.link import LinkOptions
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle

STARTS = 5
VEHICLES = 8
MANY_S = 20.0
HOUR_S = 3600
REPORT_EVERY_S = 600
TAKEOFF, ARM = 22, 400
KIBIBYTES_A_MEBIBYTE = 1024


def heartbeat_s() -> tuple[float, float]:
    """From the process's start to its first HEARTBEAT: wall clock, and processor time of the whole process."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.bind(("127.0.0.1", 0))
        client.settimeout(60.0)
        before_s, begun = children_s(), time.perf_counter()
        vehicle = start_vehicle(client)
        while message_id(client.recv(2048)) != dialect.MAVLINK_MSG_ID_HEARTBEAT:
            pass
        wall_s = time.perf_counter() - begun
        vehicle.communicate()
    return wall_s, children_s() - before_s


def start_vehicle(client: socket.socket) -> "subprocess.Popen[bytes]":
    """`rebound sim` that sends to ``client`` and ends when its input does."""
    remote = f"127.0.0.1:{client.getsockname()[1]}"
    command = [sys.executable, "-m", "rebound_cli", "sim", "--port", "0", "--stop-with-stdin", "--remote", remote]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)


def message_id(packet: bytes) -> int:
    """Of a whole packet of either version."""
    return packet[7] | packet[8] << 8 | packet[9] << 16 if packet[0] == 0xFD else packet[5]


def children_s() -> float:
    """Processor time of all processes that were waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def help_s() -> tuple[float, float]:
    """Wall clock and processor time of `rebound --help`."""
    before_s, begun = children_s(), time.perf_counter()
    subprocess.run([sys.executable, "-m", "rebound_cli", "--help"], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - begun, children_s() - before_s


def bench_start() -> None:
    """The best of a few: what else the machine does is not the vehicle's."""
    heartbeat_s()  # compiles the kernels where they are not yet
    measures: tuple[tuple[str, Callable[[], tuple[float, float]]], ...] = (
        ("rebound sim to its first HEARTBEAT", heartbeat_s),
        ("rebound --help", help_s),
    )
    for name, measure in measures:
        runs = [measure() for _ in range(STARTS)]
        wall_s, processor_s = (min(column) for column in zip(*runs, strict=True))
        print(f"{name}: {wall_s:.2f} s, of which processor {processor_s:.2f} s (best of {STARTS})")


def bench_many() -> None:
    """Each vehicle's clock, as SYSTEM_TIME and HIGHRES_IMU tell it, against ours; what all of them take of a core."""
    clients = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(VEHICLES)]
    for client in clients:
        client.bind(("127.0.0.1", 0))
        client.settimeout(60.0)
    before_s = children_s()
    vehicles = [start_vehicle(client) for client in clients]
    for client in clients:
        client.recv(2048)
    late_ms: list[list[float]] = [[] for _ in clients]
    ends = time.monotonic() + MANY_S
    for client in clients:
        client.setblocking(False)
    while time.monotonic() < ends:
        time.sleep(0.001)
        for client, lateness in zip(clients, late_ms, strict=True):
            lateness += [1e3 * time.monotonic() - stamp_ms for stamp_ms in imu_stamps_ms(client)]
    for vehicle in vehicles:
        vehicle.communicate()
    used_s = children_s() - before_s
    for number, lateness in enumerate(late_ms):
        # The offset of the two clocks is the least lateness there was.
        least = min(lateness)
        worst, middle = max(lateness) - least, statistics.median(lateness) - least
        print(f"vehicle {number}: at most {worst:.0f} ms late, {middle:.1f} in the median, {len(lateness)} samples")
    print(f"{VEHICLES} vehicles for {MANY_S:.0f} s: {used_s:.1f} s of processor, starts and stops included")
    for client in clients:
        client.close()


def imu_stamps_ms(client: socket.socket) -> list[float]:
    """The vehicle's clock in each HIGHRES_IMU that has arrived."""
    stamps = []
    while True:
        try:
            packet = client.recv(2048)
        except BlockingIOError:
            return stamps
        if message_id(packet) == dialect.MAVLINK_MSG_ID_HIGHRES_IMU:
            start = 10 if packet[0] == 0xFD else 6
            stamps.append(int.from_bytes(packet[start : start + 8], "little") / 1e3)


def bench_hour() -> None:
    """A hover of an hour with a companion's link and a ground station's, as `rebound sim --speed 0` flies it."""
    parameters = {"SIM_BAT_ENABLE": 0, "COM_RC_IN_MODE": 4}
    vehicle = SimulatedVehicle(load_built_in("foldable"), Scene(), 1, keeps_path=False, parameters=parameters)
    links = [vehicle.add_link(LinkOptions(kind)) for kind in (LinkKind.ONBOARD, LinkKind.GROUND)]
    client = dialect.MAVLink(None, 255, 190)
    begun, packets, growth = time.perf_counter(), 0, []
    for second in range(HOUR_S):
        links[1].push(client.heartbeat_encode(6, 8, 0, 0, 4).pack(client))
        if second == 5:
            for command, first in ((TAKEOFF, 0.0), (ARM, 1.0)):
                nan = float("nan")
                order = client.command_long_encode(1, 1, command, 0, first, 0, 0, nan, nan, nan, nan)
                links[1].push(order.pack(client))
        for _ in range(1_000_000 // vehicle.interval_us):
            vehicle.advance()
            packets += sum(len(link.take()) for link in links)
        if (second + 1) % REPORT_EVERY_S == 0:
            growth.append(resident_mebibytes())
            height_m = -float(vehicle._body[2])
            print(f"{(second + 1) // 60} min: {growth[-1]:.1f} MiB, {packets} packets, at {height_m:.1f} m", flush=True)
    factor = HOUR_S / (time.perf_counter() - begun)
    print(f"from 10 to 60 minutes {growth[-1] - growth[0]:+.1f} MiB; {factor:.0f} times real time")


def resident_mebibytes() -> float:
    """Memory that this process has now."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    line = next(line for line in status.splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) / KIBIBYTES_A_MEBIBYTE


BENCHES = {"start": bench_start, "many": bench_many, "hour": bench_hour}


def main(names: Sequence[str]) -> None:
    for name in names or BENCHES:
        BENCHES[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
