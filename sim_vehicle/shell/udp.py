"""The simulated vehicle in real time on UDP, at PX4's ports."""

import contextlib
import errno
import socket
import time
from collections.abc import Callable
from pathlib import Path

from sim_vehicle.errors import PortInUse
from sim_vehicle.shell.truth_file import save_truth
from sim_vehicle.vehicle import SimulatedVehicle

LISTEN_PORT = 14580
COMPANION = ("127.0.0.1", 14540)

# Lateness up to this is caught up by stepping faster, as a busy machine needs. A longer stop (a
# suspended laptop) would end in a burst of old telemetry: there the vehicle's clock stands still instead.
MOST_CAUGHT_UP_NS = 500_000_000
_LONGEST_DATAGRAM = 65_535

Address = tuple[str, int]


def serve(
    vehicle: SimulatedVehicle,
    listen_port: int = LISTEN_PORT,
    remote: Address = COMPANION,
    truth_path: Path | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> None:
    """Fly until ``stop()`` is true, one packet a datagram; then write the truth, if a path is given.

    Sends unasked to ``remote`` and, from the first datagram that arrives on, to its sender for good, as
    PX4 does. Raises PortInUse where ``listen_port`` cannot be had.
    """
    with _bound_socket(listen_port) as link:
        pace, has_peer = Pace(vehicle.time_boot_us), False
        try:
            while not stop():
                pace.wait_until(vehicle.time_boot_us + vehicle.interval_us)
                received, sender = _receive_all(link)
                if sender is not None and not has_peer:
                    remote, has_peer = sender, True
                for packet in vehicle.step(received):
                    # A full buffer or a peer that is gone loses the packet, as on any UDP link.
                    with contextlib.suppress(OSError):
                        link.sendto(packet, remote)
        finally:
            if truth_path is not None:
                save_truth(truth_path, vehicle.truth, pace.epoch_at_boot_us())


class Pace:
    """Keeps a vehicle's clock on the machine's monotonic one."""

    def __init__(
        self,
        time_boot_us: int,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        sleep_s: Callable[[float], None] = time.sleep,
    ) -> None:
        self._monotonic_ns = monotonic_ns
        self._sleep_s = sleep_s
        self._boot_ns = monotonic_ns() - 1000 * time_boot_us

    def wait_until(self, time_boot_us: int) -> None:
        """Return when the vehicle's clock may show that; at once when it is late."""
        now_ns = self._monotonic_ns()
        due_ns = self._boot_ns + 1000 * time_boot_us
        if due_ns > now_ns:
            self._sleep_s(1e-9 * (due_ns - now_ns))
        elif now_ns - due_ns > MOST_CAUGHT_UP_NS:
            self._boot_ns += now_ns - due_ns

    def epoch_at_boot_us(self) -> int:
        """Wall clock at the vehicle's boot time 0."""
        return (time.time_ns() - self._monotonic_ns() + self._boot_ns) // 1000


def _bound_socket(port: int) -> socket.socket:
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        link.bind(("0.0.0.0", port))
    except OSError as problem:
        link.close()
        if problem.errno == errno.EADDRINUSE:
            raise PortInUse(
                f"UDP port {port} is in use: another simulation may be running; stop it or choose another port."
            ) from problem
        raise PortInUse(f"UDP port {port} cannot be opened: {problem.strerror}; choose another port.") from problem
    link.setblocking(False)
    return link


def _receive_all(link: socket.socket) -> tuple[bytes, Address | None]:
    """Everything that has arrived, in order, and who sent the first of it."""
    datagrams: list[bytes] = []
    first_sender: Address | None = None
    while True:
        try:
            datagram, sender = link.recvfrom(_LONGEST_DATAGRAM)
        except BlockingIOError:
            return b"".join(datagrams), first_sender
        except ConnectionError:
            # Some systems report here that an earlier packet found nobody.
            continue
        datagrams.append(datagram)
        first_sender = first_sender or sender
