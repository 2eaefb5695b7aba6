"""`rebound preflight` on a real connection and the real clock."""

import json
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from companion.autopilot.setup import PreflightItem, SerialLine, Verdict
from companion.errors import ConfigurationError
from companion.link.vehicle import Vehicle
from companion.preflight import Preflight, findings
from companion.shell.clock import Clock
from companion.shell.connections.addresses import parsed
from companion.shell.connections.connection import Connection
from rebound_cli.inputs.inputs import companion_settings
from rebound_cli.live.console import Console, console_for
from rebound_cli.live.signed_connection import open_signed, refused_packets, unheard_text

LONGEST_WAIT_S = 0.05
# PX4 answers a parameter within 50 ms; after a second it has not taken it.
SETTING_TAKES_S = 1.0


def run_preflight(options: Namespace) -> int:
    """Print the findings; 0 when none of them is bad. Raises ConfigurationError, ConnectionSetupError."""
    console, clock = console_for(options.json), Clock()
    config = companion_settings(options.companion)
    connection = open_signed(options)
    try:
        preflight = Preflight(config, clock.now_us(), serial_line(options.connect))
        console.print(f"Listening on {options.connect}; this takes 11 s from the vehicle's first heartbeat on.")
        while not preflight.finished:
            _exchange(preflight, connection, clock)
            if (news := connection.news()) is not None:
                console.print(news)
        if preflight.refusal is not None:
            refusal = preflight.refusal[:1].upper() + preflight.refusal[1:]
            raise ConfigurationError(f"{refusal}.{unheard_text(refused_packets(connection))}")
        found = findings(preflight)
        show(console, preflight.vehicle, found)
        if options.json:
            print(json.dumps([{**asdict(finding), "verdict": finding.verdict.value} for finding in found], indent=2))
        if options.fix:
            found = _fix(console, preflight, connection, clock, found)
    finally:
        connection.close()
    return 1 if any(finding.verdict is Verdict.BAD for finding in found) else 0


def serial_line(url: str, system: Path = Path("/")) -> SerialLine | None:
    """What the link goes through; None on a network. `system` is where sys is."""
    _, scheme, device, baud = parsed(url)
    if scheme != "serial":
        return None
    name, timer_ms = Path(device).resolve().name, None
    # The driver of FTDI's converters has it, and no other.
    with suppress(OSError, ValueError):
        timer_ms = int((system / "sys/bus/usb-serial/devices" / name / "latency_timer").read_text())
    return SerialLine(None if name.startswith("ttyACM") else baud, timer_ms)


def _exchange(preflight: Preflight, connection: Connection, clock: Clock) -> None:
    for frame in preflight.step(connection.receive(LONGEST_WAIT_S), clock.now_us()):
        connection.send(frame)


def show(console: Console, vehicle: Vehicle, found: list[PreflightItem]) -> None:
    """What was met, and each finding with its remedy."""
    kind = "vehicle" if vehicle.identity is None else f"{vehicle.autopilot_text()}, {vehicle.identity.vehicle_type}"
    console.print(f"\n{kind}")
    show_findings(found, 20, console.print)
    counts = [sum(finding.verdict is verdict for finding in found) for verdict in Verdict]
    console.print(f"\n  {counts[0]} good, {counts[1]} worth a look, {counts[2]} in the way of a flight")


def show_findings(found: Sequence[PreflightItem], width: int, tell: Callable[[str], None]) -> int:
    """The exit code: 0 when none of them is bad."""
    for finding in found:
        tell(f"  {finding.verdict.value:4}  {finding.item:{width}} {finding.found}")
        if finding.remedy:
            tell(f"        {'':{width}} -> {finding.remedy}")
    return int(any(finding.verdict is Verdict.BAD for finding in found))


def _fix(
    console: Console, preflight: Preflight, connection: Connection, clock: Clock, found: list[PreflightItem]
) -> list[PreflightItem]:
    """Set what can be set, one by one as the person agrees; the findings afterwards."""
    if preflight.vehicle.armed:
        raise ConfigurationError("The vehicle is armed: nothing is set on a vehicle that may be flying.")
    for finding in found:
        if finding.fix is None:
            continue
        name, value = finding.fix
        console.ask(f"Set {name} = {value:g}? [y/N] ")
        # The end of input is a no.
        if sys.stdin.readline().strip().lower() not in ("y", "yes"):
            continue
        for frame in preflight.set_parameter(name, value, clock.now_us()):
            connection.send(frame)
        until_us = clock.now_us() + round(SETTING_TAKES_S * 1e6)
        while name not in preflight.parameters and clock.now_us() < until_us:
            _exchange(preflight, connection, clock)
        answer = preflight.parameters.get(name)
        console.print(f"  {name} is {'not told' if answer is None else format(answer, 'g')} now")
    return findings(preflight)
