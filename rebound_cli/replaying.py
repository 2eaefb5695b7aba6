"""`rebound replay`: from a log to its collisions."""

import re
from argparse import Namespace
from collections.abc import Callable
from functools import partial

from companion.errors import ConfigurationError
from companion.guard.config import GuardConfig
from rebound_cli.inputs.inputs import companion_settings
from rebound_cli.live.console import Console, console_for
from rebound_cli.logs.reader import read_log, read_telemetry
from rebound_cli.replay.recording import is_run_folder, log_file, read_recording, settings_file
from rebound_cli.replay.report import Replay, replay_flight, replay_log, report_text
from rebound_cli.report.page import write_page
from rebound_cli.report.shown_flight import ShownFlight, decided_again, replayed_flight
from rebound_cli.results.run_folder import REPORT_NAME, RUNS_FOLDER, versions

# Of a flight that shows that there was no collision: most of it.
LEAST_WATCHED = 0.5


def run_replay(options: Namespace) -> int:
    """Print the findings, write their page.

    1 when they are not what was expected, when a flight did not come again, or when nothing was watched.
    """
    if options.least_watched is not None and options.expect != 0:
        raise ConfigurationError("--least-watched belongs to --expect none: leave it out here.")
    console = console_for(False)
    replay, shown = _replay(options, console)
    slug = re.sub(r"[^A-Za-z0-9_.-]+", "-", options.log.resolve().name.removesuffix(options.log.suffix)) or "log"
    folder = options.out or RUNS_FOLDER / f"replay-{slug}"
    console.print(report_text(replay).rstrip())
    if replay.findings.impacts:
        folder.mkdir(parents=True, exist_ok=True)
        console.print(f"page: {write_page(shown(), folder / REPORT_NAME)}")
    least_watched = LEAST_WATCHED if options.least_watched is None else options.least_watched
    return _exit_code(replay, options.expect, least_watched, console)


def _replay(options: Namespace, console: Console) -> tuple[Replay, Callable[[], ShownFlight]]:
    """What was found, and all that a page shows of it."""
    file = log_file(options.log)
    folder = options.log if is_run_folder(options.log) else None
    # Options under which a flight is no longer the one that was flown.
    changing = ("companion", "set", "any_mode")
    changed = [f"--{name.replace('_', '-')}" for name in changing if getattr(options, name) not in (None, [], False)]
    if folder is not None and not changed:
        recording = read_recording(folder)
        now, then = versions(), recording.versions
        other = [f"{name} {then[name]}, now {now.get(name)}" for name in then if now.get(name) != then[name]]
        if other:
            console.print(f"flown with other versions, so bits may differ: {'; '.join(other)}")
        replay = replay_flight(read_telemetry(file), recording)
        return replay, partial(decided_again, folder, recording, replay.findings, replay.difference)
    settings = options.companion
    if folder is not None and settings is None:
        console.print(f"with {', '.join(changed)} the flight's own decisions cannot come again and are not compared")
        settings = settings_file(folder)
    config = companion_settings(settings, options.set)
    replay = replay_log(read_log(file), config, None if options.any_mode else GuardConfig().modes)
    return replay, partial(replayed_flight, replay)


def _exit_code(replay: Replay, expected: int | None, least_watched: float, console: Console) -> int:
    found, share = len(replay.findings.collisions), replay.findings.watched_share
    if expected is not None and found != expected:
        console.print(f"expected {expected or 'no'} collisions, found {found}")
        return 1
    if expected == 0 and (share is None or share < least_watched):
        seen = "nothing" if share is None else f"{100.0 * share:.0f} %"
        console.print(f"expected no collisions, and {seen} of the flight was watched: that shows none")
        return 1
    if replay.recording is not None:
        return int(replay.difference is not None)
    # Who expects something has said how much must have been watched.
    return int(share is None or (share == 0.0 and expected is None))
