"""What systemd is told of this program, by sd_notify's protocol: it is ready, it decides, how it goes, it ends.

The watchdog is fed by the step that decides and by nothing else. A thread of its own would go on feeding it beside a
loop that hangs.
"""

import math
import os
import socket
import threading
from collections import deque
from collections.abc import Callable, Mapping

# As often as a person reads a line, and as PX4 sends its heartbeat.
STATUS_EVERY_US = 1_000_000
# Before all that share a processor by turns, after the kernel's own threads for interrupts (50). The kernel leaves
# others a twentieth of the time (sched_rt_runtime_us).
PRIORITY = 10


class ServiceManager:
    """The socket of $NOTIFY_SOCKET. No call waits or raises; what could not be sent is due again at the next step.

    Times in microseconds, any epoch. `watchdog_us`: how long systemd waits for a sign of life; None: it does not.
    """

    def __init__(self, address: str, watchdog_us: int | None) -> None:
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._watchdog_us = watchdog_us
        self._told: dict[str, str] = {}
        self._fed_us = -math.inf
        self._looked_us = -math.inf  # at the status
        self._error: OSError | None = None
        self._news = deque[str]()

    def go_first(self) -> None:
        """Have this process run before all other programs, where the system lets it: its threads, and those to come."""
        try:
            for thread in threading.enumerate():
                os.sched_setscheduler(thread.native_id or 0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        except OSError as error:
            self._news.append(f"a busy computer may delay setpoints: {error.strerror or error} (SCHED_FIFO)")

    def stepped(self, is_heard: bool, is_ending: bool, status: Callable[[], str], now_us: int) -> None:
        """After each step that decides: whether the vehicle is heard, and whether this is the beginning of the end."""
        due = {"READY": "1"} if is_heard else {}
        if is_ending:
            due["STOPPING"] = "1"
        if now_us - self._looked_us >= STATUS_EVERY_US:
            self._looked_us, due["STATUS"] = now_us, status()
        due = {name: value for name, value in due.items() if self._told.get(name, "") != value}
        # Half of the time that systemd waits, as sd_watchdog_enabled(3) asks.
        is_hungry = self._watchdog_us is not None and now_us - self._fed_us >= self._watchdog_us // 2
        if is_hungry:
            due["WATCHDOG"] = "1"
        if not due:
            return
        try:
            self._socket.sendto("\n".join(f"{name}={value}" for name, value in due.items()).encode(), self._address)
        except BlockingIOError:
            # systemd is busy: the next step tries again.
            return
        except OSError as error:
            if self._error is None:
                self._news.append(f"systemd is not told: {error.strerror or error}")
            self._error = error
            return
        self._told |= due
        self._fed_us = now_us if is_hungry else self._fed_us

    def news(self) -> str | None:
        """Why systemd is not told, or gives no priority; once."""
        return self._news.popleft() if self._news else None


def service_manager(environment: Mapping[str, str] = os.environ) -> ServiceManager | None:
    """The one that started this process; None without, or where its socket is of a kind that no systemd here has."""
    address = environment.get("NOTIFY_SOCKET", "")
    if not address.startswith(("/", "@")):
        return None
    period_us, own = environment.get("WATCHDOG_USEC", ""), str(os.getpid())
    is_watched = period_us.isdecimal() and environment.get("WATCHDOG_PID", own) == own
    return ServiceManager(address, int(period_us) if is_watched else None)
