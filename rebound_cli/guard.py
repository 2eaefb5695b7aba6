"""`rebound guard` on a real connection and the real clock: until Ctrl-C, SIGTERM, or nothing to guard."""

from argparse import Namespace
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict
from pathlib import Path

from companion.companion import StepResult
from companion.errors import ReboundError
from companion.guard.between import Between
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from companion.shell.clock import Clock
from companion.shell.connections.addresses import Opened
from companion.shell.connections.clients import SharedConnection, carried_bytes_s
from companion.shell.connections.connection import Connection, plain
from companion.shell.service_manager import ServiceManager, service_manager
from rebound_cli.background import Background
from rebound_cli.flights.kept import folder_with_room, hits_text
from rebound_cli.inputs.documents import Document, apply_overrides, load_document, validated
from rebound_cli.live.console import Console, console_for
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.live.realtime import Loop, watched
from rebound_cli.live.signed_connection import open_signed, refused_packets, unheard_text
from rebound_cli.live.status import served
from rebound_cli.report.showing import offer_page
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import FlightRecorder


def run_guard(options: Namespace) -> None:
    """Guard until told to stop. Raises ReboundError where there is nothing that can be guarded."""
    config = guard_config(options)
    run_folder.check_place(options.out)
    with console_for(False, Background("console")) as console:
        # The address is tried before anything is written: a wrong one leaves no empty folder behind.
        between = Between(carried_bytes_s(options.connect)) if config.between else None

        def shared(opened: Opened) -> Connection:
            return opened if between is None else SharedConnection(opened, config.between, between)

        connection = open_signed(options, config.companion.link.wait, shared)
        manager = service_manager()
        with closing(connection), Interrupts() as interrupts:
            while not (outcome := _recorded(config, options.out, connection, console, interrupts, manager, between)):
                # One that has met its vehicle goes on waiting for it.
                link = config.companion.link.model_copy(update={"wait": True})
                config = config.model_copy(update={"companion": config.companion.model_copy(update={"link": link})})
        if interrupts.reason is None:
            text = outcome[:1].upper() + outcome[1:] + ("" if outcome.endswith("?") else ".")
            raise ReboundError(text + unheard_text(refused_packets(connection)))


def _recorded(
    config: GuardConfig,
    out: Path | None,
    connection: Connection,
    console: Console,
    interrupts: Interrupts,
    manager: ServiceManager | None,
    between: Between | None,
) -> str:
    """One folder: until the end, which is returned, or, then empty, until it is long and the vehicle disarmed."""
    folder, ring = folder_with_room(out, "guard", config.companion.disk)
    settings = config.model_dump(mode="json", exclude_none=True)
    with _reporting(console, folder):
        run_folder.write_yaml(folder / run_folder.GUARD_NAME, settings)
        run_folder.write_json(folder / run_folder.VERSIONS_NAME, run_folder.versions())
    recorder = FlightRecorder(folder, Background("log"), ring.make_room)
    guard, kept_out = Guard(config), 0 if between is None else between.kept_out
    end = "cut off"
    try:
        with (
            served(console.print, command="guard", folder=str(folder.resolve())) as server,
            watched(folder, config.companion.operator.computer_status) as computer,
        ):
            clock = Clock()
            started_us = clock.now_us()
            loop = Loop(guard, connection, clock, recorder, console, interrupts, server, computer, manager=manager)

            def beside(now_us: int, result: StepResult) -> None:
                console.events(result.events, started_us)
                if between is not None:
                    for kind, said in guard.look_at(between, now_us):
                        recorder.record_input(now_us, kind, **said)

            loop.run(beside, lambda: ring.is_long and guard.armed is False and interrupts.reason is None)
            end = "goes on in the next folder"
    finally:
        recorder.close()
        core, flight = guard.core, guard.core.flight
        outcome, hits = flight.reason, [asdict(collision) for collision in core.collisions()]
        summary = {
            "outcome": outcome or end,
            "collisions": hits,
            "left_alone": flight.left_alone,
            "crashed": flight.crashed or None,
            "kept_out": 0 if between is None else between.kept_out - kept_out,
            "round_trip_ms": flight.round_trip.summary_ms(),
            **asdict(connection.counts),
            "refused_packets": refused_packets(connection),
        }
        with _reporting(console, folder):
            run_folder.write_json(folder / run_folder.SUMMARY_NAME, summary)
    if outcome and flight.vehicle.identity is None and not flight.fault:
        # No vehicle was met: it is no flight.
        run_folder.forget(folder)
        return outcome
    left_alone = f", {flight.left_alone} left to the program that flies" if flight.left_alone else ""
    console.print(f"{summary['outcome']}; {hits_text(len(hits))}{left_alone}; log in {folder}")
    if outcome:
        offer_page(folder, console)
    return outcome


@contextmanager
def _reporting(console: Console, folder: Path) -> Iterator[None]:
    """What cannot be written, as on a full disk, is reported, and keeps no vehicle from being guarded."""
    try:
        yield
    except OSError as error:
        console.print(f"{folder}: not all can be written: {plain(error)}")


def guard_config(options: Namespace) -> GuardConfig:
    """The file's settings, then --set, --modes and --then. Raises DocumentError."""
    document = load_document(options.config) if options.config is not None else Document("no file of settings")
    apply_overrides(document, options.set)
    if options.modes is not None:
        modes = [mode.strip().upper() for mode in options.modes.split(",")]
        document.put_option("--modes", ("modes",), modes, options.modes)
    for option, path in (("wait", ("companion", "link", "wait")), ("between", ("between",)), ("then", ("then",))):
        if value := getattr(options, option):
            document.put_option(f"--{option}", path, value)
    return validated(GuardConfig, document, document.data)
