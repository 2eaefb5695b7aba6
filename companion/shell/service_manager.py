"""What systemd is told of this program, by sd_notify's protocol: it is ready, it decides, how it goes, it ends.

The watchdog is fed by the step that decides and by nothing else. A thread of its own would go on feeding it beside a
loop that hangs.
"""

import os
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass

# As often as a person reads a line, and as PX4 sends its heartbeat.
STATUS_EVERY_US = 1_000_000


@dataclass(slots=True)
class Notices:
    """What is due after a step; times in microseconds, any epoch. What was not sent is due again."""

    watchdog_us: int | None  # how long systemd waits for a sign of life; None: it does not
    is_ready: bool = False
    is_stopping: bool = False
    status: str = ""
    _fed_us: int | None = None
    _looked_us: int | None = None  # at the status

    def due(self, is_heard: bool, is_ending: bool, status: Callable[[], str], now_us: int) -> list[str]:
        lines = ["READY=1"] if is_heard and not self.is_ready else []
        if is_ending and not self.is_stopping:
            lines.append("STOPPING=1")
        # Half of the time that systemd waits, as sd_watchdog_enabled(3) asks.
        if self.watchdog_us is not None and _has_passed(self._fed_us, self.watchdog_us // 2, now_us):
            lines.append("WATCHDOG=1")
        if _has_passed(self._looked_us, STATUS_EVERY_US, now_us):
            self._looked_us = now_us
            if (text := status()) != self.status:
                lines.append(f"STATUS={text}")
        return lines

    def told(self, lines: list[str], now_us: int) -> None:
        """These have been sent."""
        for line in lines:
            name, _, value = line.partition("=")
            if name == "READY":
                self.is_ready = True
            elif name == "STOPPING":
                self.is_stopping = True
            elif name == "WATCHDOG":
                self._fed_us = now_us
            else:
                self.status = value


def _has_passed(since_us: int | None, interval_us: int, now_us: int) -> bool:
    return since_us is None or now_us - since_us >= interval_us


class ServiceManager:
    """The socket of $NOTIFY_SOCKET. No call waits or raises; what could not be sent is due again at the next step."""

    def __init__(self, address: str, watchdog_us: int | None) -> None:
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._notices = Notices(watchdog_us)
        self._error: OSError | None = None
        self._is_told = False

    def stepped(self, is_heard: bool, is_ending: bool, status: Callable[[], str], now_us: int) -> None:
        """After each step that decides: whether the vehicle is heard, and whether this is the beginning of the end."""
        lines = self._notices.due(is_heard, is_ending, status, now_us)
        if not lines:
            return
        try:
            self._socket.sendto("\n".join(lines).encode(), self._address)
        except BlockingIOError:
            # systemd is busy: the next step tries again.
            return
        except OSError as error:
            self._error = error
            return
        self._notices.told(lines, now_us)

    def news(self) -> str | None:
        """Why systemd is not told, once."""
        if self._error is None or self._is_told:
            return None
        self._is_told = True
        return f"systemd is not told: {self._error.strerror or self._error}"


def service_manager(environment: Mapping[str, str] | None = None) -> ServiceManager | None:
    """The one that started this process; None without, or where its socket is of a kind that no systemd here has."""
    given = os.environ if environment is None else environment
    address = given.get("NOTIFY_SOCKET", "")
    if not address.startswith(("/", "@")):
        return None
    period_us, own = given.get("WATCHDOG_USEC", ""), str(os.getpid())
    is_watched = period_us.isdecimal() and given.get("WATCHDOG_PID", own) == own
    return ServiceManager(address, int(period_us) if is_watched else None)
