"""`bench soak`: what a service goes through in hours, and what it takes of the computer meanwhile."""

import json
import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from bench.fly.packets import ARM, COMMAND, GROUND_STATION, SET_MODE, made
from bench.rows.tables import Page, table
from bench.stamps import FLOWN, ROOT
from bench.studies.cable import Cable
from companion.mavlink.packet import message_id_of
from rebound_cli.flights.kept import hits_in, kept_flights
from rebound_cli.live.status import StatusError, ask
from rebound_cli.replay.recording import read_recording, reproduce
from sim_vehicle.errors import ConditionNotMet
from sim_vehicle.testing import RunningVehicle, start_vehicle

BAUD, BUDGET_MB = 921_600, 60
# The unit's WatchdogSec.
WATCHDOG_S = 5.0
HIT_M_S = 1.5
UNPLUGGED_S = 3.0
# Every so many minutes: the vehicle starts anew, the line is pulled out, the disk is full until the minute ends.
REBOOT, UNPLUG, FILL = 5, 4, 6
SMALL_DISK_BYTES = 1_000_000_000
CODE = (*FLOWN, "rebound_cli")
# The status is no newer than this.
_LOOK_S, _TRIES = 0.1, 50
TAKEOFF, LAND = (4, 2), (4, 6)  # PX4's main and sub mode


class Systemd(threading.Thread):
    """The end of $NOTIFY_SOCKET: how often the watchdog was fed, and for how long it was not at most."""

    def __init__(self, path: Path) -> None:
        super().__init__(daemon=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(path))
        self.pings, self.missed, self.longest_s, self._fed_s = 0, 0, 0.0, 0.0

    def run(self) -> None:
        while True:
            self.take(self._socket.recv(4096), time.monotonic())

    def take(self, said: bytes, now_s: float) -> None:
        if b"WATCHDOG=1" in said.split(b"\n"):
            if self.pings:
                self.longest_s = max(self.longest_s, now_s - self._fed_s)
                self.missed += now_s - self._fed_s > WATCHDOG_S
            self.pings, self._fed_s = self.pings + 1, now_s


@dataclass(frozen=True, slots=True)
class Minute:
    """What was done in it and what came of it; memory and disk at its end."""

    done: str
    found: int
    """Hits that the guard told of; one was flown."""
    recorded: int
    """Of these in events.jsonl."""
    reconnected_s: float | None
    resident_kb: int
    cpu_s: float
    flights: int
    flights_mb: float


class Soak:
    """One guard, one line, vehicles one after the other."""

    def __init__(self, folder: Path, sockets: Path, cable: Cable, guard: int) -> None:
        self.folder, self._socket, self._cable, self._guard = folder, sockets / "status.sock", cable, guard
        self._vehicle: RunningVehicle | None = None
        self._pilot = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.trouble: list[str] = []

    def minute(self, number: int) -> Minute:
        end_s, done, reconnected_s = time.monotonic() + 60.0, ["hit"], None
        if number % REBOOT == 0:
            done.append("reboot in the air" if number // REBOOT % 2 else "landing, reboot")
            self._fly(number, is_landed=number // REBOOT % 2 == 0)
        if number % UNPLUG == 2:
            done.append("unplugged")
            reconnected_s = self._unplug()
        ballast = self.folder / "ballast"
        if number % FILL == 4 and shutil.disk_usage(self.folder).total < SMALL_DISK_BYTES:
            done.append("disk full")
            _fill(ballast)
        before = self._status()
        assert self._vehicle is not None
        self._vehicle.hit(HIT_M_S, bearing_deg=37.0 * number % 360.0)
        self._until(lambda: self._status()["hits"] > before["hits"], 5.0, f"minute {number}: hit not found")
        self._until(self._is_watching, 30.0, f"minute {number}: not given back")
        time.sleep(max(end_s - time.monotonic(), 0.0))
        after, flights = self._status(), kept_flights(self.folder / "runs")
        ballast.unlink(missing_ok=True)
        lines = (Path(after["folder"]) / "events.jsonl").read_text().splitlines()
        resident_kb, cpu_s = _taken(self._guard)
        used_mb = sum(flight.size_bytes for flight in flights) / 1e6
        found, recorded = after["hits"] - before["hits"], hits_in(lines) - before["hits"]
        said = ", ".join(done)
        return Minute(said, found, recorded, reconnected_s, resident_kb, cpu_s, len(flights), round(used_mb, 1))

    def end(self) -> None:
        if self._vehicle is not None:
            self._vehicle.stop()
        self._pilot.close()

    def _fly(self, number: int, is_landed: bool) -> None:
        if self._vehicle is not None:
            if is_landed:
                self._mode(LAND)
                self._vehicle.wait_until(lambda truth: not truth.is_armed, within_s=30)
            self._vehicle.stop()
        self._vehicle = start_vehicle(links=(self._cable.vehicle_url,), seed=number + 1)
        self._vehicle.wait_until(lambda truth: truth.may_arm, within_s=30)
        self._command(ARM, 1.0)
        self._mode(TAKEOFF)
        self._vehicle.wait_until(lambda truth: truth.mode == "Hold" and truth.height_m > 2.0, within_s=30)
        self._until(self._is_watching, 30.0, f"minute {number}: not watched")

    def _unplug(self) -> float | None:
        self._cable.unplug()
        time.sleep(UNPLUGGED_S)
        self._cable.plug()
        plugged_us = time.time_ns() // 1000
        again: list[int] = []

        def is_again() -> bool:
            for line in (Path(self._status()["folder"]) / "events.jsonl").read_text().splitlines():
                event = json.loads(line)
                if event["time_us"] > plugged_us and "connected again" in event["text"]:
                    again.append(event["time_us"])
            return bool(again)

        self._until(is_again, 5.0, "not connected again")
        self._until(self._is_watching, 10.0, "not watched again")
        return round((again[0] - plugged_us) / 1e6, 2) if again else None

    def _status(self) -> Mapping[str, Any]:
        """Raises StatusError. While a record ends and the next one begins nobody answers."""
        for _ in range(_TRIES):
            with suppress(StatusError):
                return ask(self._socket)
            time.sleep(_LOOK_S)
        return ask(self._socket)

    def _is_watching(self) -> bool:
        return bool(self._status()["state"] == "watching" and self._status()["vehicle_mode"] == "AUTO.LOITER")

    def _until(self, condition: Callable[[], bool], within_s: float, otherwise: str) -> None:
        end_s = time.monotonic() + within_s
        while time.monotonic() < end_s:
            if condition():
                return
            time.sleep(_LOOK_S)
        self.trouble.append(otherwise)

    def _mode(self, mode: tuple[int, int]) -> None:
        self._command(SET_MODE, 1.0, *map(float, mode))

    def _command(self, command: int, *parameters: float) -> None:
        fields = {f"param{index}": value for index, value in enumerate(parameters, start=1)}
        asked = {"command": command, "target_system": 1, "target_component": 1, **fields}
        frame = made("COMMAND_LONG", asked, GROUND_STATION)
        assert self._vehicle is not None and message_id_of(frame) == COMMAND
        self._pilot.sendto(frame, ("127.0.0.1", self._vehicle.udp_port))


def _fill(ballast: Path) -> None:
    with suppress(OSError), ballast.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))


def _taken(pid: int) -> tuple[int, float]:
    """Resident memory in kB, and seconds of a processor since the start."""
    status = Path(f"/proc/{pid}/status").read_text()
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return int(status.split("VmRSS:")[1].split()[0]), (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def run_soak(options: Namespace) -> int:
    """0 when nothing was lost but what a full disk took."""
    options.folder.mkdir(parents=True, exist_ok=True)
    page = Page(options.out, "soak")
    minutes: list[Minute] = []
    with ExitStack() as stack:
        sockets = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        cable = stack.enter_context(Cable(sockets / "pixhawk", BAUD, options.loss))
        systemd = Systemd(sockets / "notify")
        systemd.start()
        environment = {"NOTIFY_SOCKET": str(sockets / "notify"), "WATCHDOG_USEC": str(round(WATCHDOG_S * 1e6))}
        environment |= {"RUNTIME_DIRECTORY": str(sockets), "PYTHONPATH": str(ROOT)}
        python = options.python or sys.executable
        command = [python, "-P", "-m", "rebound_cli", "guard", "--wait", "--connect", cable.url]
        command += ["--set", f"companion.disk.max_use_mb={BUDGET_MB}"]
        # As journald's it is on another disk.
        said = stack.enter_context(options.folder.with_suffix(".journal").open("w"))
        guard = subprocess.Popen(command, cwd=options.folder, env=os.environ | environment, stdout=said, stderr=said)
        stack.callback(guard.wait, 20)
        stack.callback(guard.terminate)
        soak = Soak(options.folder, sockets, cable, guard.pid)
        stack.callback(soak.end)
        cable.plug()
        with suppress(StatusError, ConditionNotMet):
            for number in range(options.minutes):
                minutes.append(soak.minute(number))
                print(json.dumps(asdict(minutes[-1])), *soak.trouble, flush=True)
        if len(minutes) < options.minutes:
            soak.trouble.append(f"nothing answered in minute {len(minutes)}")
    facts = {**figures(minutes, systemd, soak.trouble), **_flown_again(options.folder / "runs")}
    text = table([{"": name, "measured": value} for name, value in facts.items()])
    page.write("Hours as a service", options.typed, {"": text}, rows=pd.DataFrame(map(asdict, minutes)), code=CODE)
    print(text)
    return 0 if guard.returncode == 0 and not soak.trouble else 1


def figures(minutes: Sequence[Minute], systemd: Systemd, trouble: Sequence[str]) -> dict[str, str]:
    """The flights themselves apart."""
    resident_mb = [minute.resident_kb / 1e3 for minute in minutes]
    again_s = [minute.reconnected_s for minute in minutes if minute.reconnected_s is not None]
    busy_s = minutes[-1].cpu_s - minutes[0].cpu_s
    slope = statistics.linear_regression(range(len(minutes)), resident_mb).slope if len(minutes) > 1 else 0.0
    return {
        "hits flown, found, in the record": _hits(minutes),
        "the same while the disk was full": _hits([minute for minute in minutes if "disk full" in minute.done]),
        "the vehicle started anew": f"{sum('reboot' in minute.done for minute in minutes)} times",
        "line unplugged, connected again": f"{sum('unplugged' in m.done for m in minutes)}, {len(again_s)} times",
        "plugged in → connected again": f"at most {max(again_s, default=0.0):.2f} s",
        "flights on disk, at most": f"{max(minute.flights_mb for minute in minutes):.1f} MB of {BUDGET_MB} MB",
        "resident memory, first, median, last minute": ", ".join(
            f"{value:.1f} MB" for value in (resident_mb[0], statistics.median(resident_mb), resident_mb[-1])
        ),
        "its slope": f"{60 * slope:+.2f} MB an hour",
        "CPU": f"{100 * busy_s / max(60 * (len(minutes) - 1), 1):.1f} % of a core",
        "watchdog fed, longest pause": f"{systemd.pings} times, {systemd.longest_s:.1f} s",
        f"watchdog fed later than after {WATCHDOG_S:g} s": f"{systemd.missed} times",
        "trouble": "; ".join(trouble) or "none",
    }


def _hits(minutes: Sequence[Minute]) -> str:
    return f"{len(minutes)}, {sum(minute.found for minute in minutes)}, {sum(minute.recorded for minute in minutes)}"


def _flown_again(runs: Path) -> dict[str, str]:
    """Whether each record of a flight gives the same decisions again."""
    flights = kept_flights(runs)
    same = [reproduce(read_recording(flight.folder)).first_difference is None for flight in flights]
    kept = sum(hits_in(flight.event_lines()) for flight in flights)
    return {
        "records that decide the same again": f"{sum(same)} of {len(flights)}",
        "hits in the records that are left on the disk": str(kept),
    }
