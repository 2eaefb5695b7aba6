"""`rebound guard` on a real connection and the real clock: until Ctrl-C, SIGTERM, or nothing to guard."""

from argparse import Namespace
from dataclasses import asdict

from companion.errors import ReboundError
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from companion.shell.clock import Clock
from rebound_cli import run_folder
from rebound_cli.background import Background
from rebound_cli.compiling import prepare_companion
from rebound_cli.console import console_for
from rebound_cli.documents import Document, apply_overrides, load_document, validated
from rebound_cli.flights.kept import room_for
from rebound_cli.interrupts import Interrupts
from rebound_cli.offering import offer_report
from rebound_cli.realtime import Loop, watched
from rebound_cli.run_folder import FlightRecorder
from rebound_cli.signed_connection import open_signed, refused_packets
from rebound_cli.status import served


def run_guard(options: Namespace) -> int:
    """Guard until told to stop; 0 then. Raises ReboundError where there is nothing that can be guarded."""
    config = guard_config(options)
    run_folder.check_place(options.out)
    with console_for(False, Background("console")) as console:
        prepare_companion(console, config.companion)
        # The address is tried before anything is written: a wrong one leaves no empty folder behind.
        connection = open_signed(options, config.companion.link.wait)
        folder = run_folder.create_run_folder(options.out, "guard")
        run_folder.write_yaml(folder / run_folder.GUARD_NAME, config.model_dump(mode="json", exclude_none=True))
        run_folder.write_json(folder / run_folder.VERSIONS_NAME, run_folder.versions())
        recorder = FlightRecorder(folder, Background("log"), room_for(folder, options.out, config.companion.disk))
        guard = Guard(config)
        try:
            with (
                served(console.print, command="guard", folder=str(folder.resolve())) as server,
                watched(folder, config.companion.operator.computer_status) as computer,
                Interrupts() as interrupts,
            ):
                clock = Clock()
                started_us = clock.now_us()
                loop = Loop(guard, connection, clock, recorder, console, interrupts, server, computer)
                loop.run(lambda _, result: console.events(result.events, started_us))
        finally:
            connection.close()
            recorder.close()
            hits = [asdict(collision) for collision in guard.collisions()]
            summary = {
                "outcome": guard.outcome,
                "collisions": hits,
                "left_alone": guard.left_alone(),
                "round_trip_ms": guard.round_trip().summary(),
                **asdict(connection.counts),
                "refused_packets": refused_packets(connection),
            }
            run_folder.write_json(folder / run_folder.SUMMARY_NAME, summary)
        left_alone = f", {guard.left_alone()} left to the program that flies" if guard.left_alone() else ""
        console.print(f"{guard.outcome}; {len(hits)} hits{left_alone}; log in {folder}")
        offer_report(folder, console)
        if interrupts.reason is None:
            raise ReboundError(
                guard.outcome[:1].upper() + guard.outcome[1:] + ("" if guard.outcome.endswith("?") else ".")
            )
        return 0


def guard_config(options: Namespace) -> GuardConfig:
    """The file's settings, then --set, --modes and --then. Raises DocumentError."""
    document = load_document(options.config) if options.config is not None else Document("no file of settings")
    apply_overrides(document, options.set)
    if options.modes is not None:
        modes = [mode.strip().upper() for mode in options.modes.split(",")]
        document.put_option("--modes", ("modes",), modes, options.modes)
    if options.wait:
        document.put_option("--wait", ("companion", "link", "wait"), True)
    if options.then is not None:
        document.put_option("--then", ("then",), options.then)
    return validated(GuardConfig, document, document.data)
