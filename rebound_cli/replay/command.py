"""`rebound replay`: from a log to its collisions."""

import json
import re
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from companion.errors import ConfigurationError
from rebound_cli.console import Console, console_for
from rebound_cli.logs.log import LogError
from rebound_cli.logs.reader import read_log
from rebound_cli.logs.telemetry import read_telemetry
from rebound_cli.replay.recording import Recording, is_run_folder, read_recording, settings_file
from rebound_cli.replay.report import report_data, report_text
from rebound_cli.replay.result import Replay, replay_flight, replay_log
from rebound_cli.replay.settings import companion_settings
from rebound_cli.run_folder import RUNS_FOLDER, TLOG_NAME, versions


def run_replay(options: Namespace) -> int:
    """Print the findings and draw them. 1 when they are not what was expected, or a flight did not come again."""
    console = console_for(options.json)
    replay = _replay(options, console)
    pictures = _draw(replay, options.out or RUNS_FOLDER / f"replay-{_slug(options.log)}")
    if options.json:
        print(json.dumps(report_data(replay, pictures), indent=2))
    else:
        console.print(report_text(replay, pictures).rstrip())
    return _exit_code(replay, options.expect, options.least_watched, console)


def _replay(options: Namespace, console: Console) -> Replay:
    folder = options.log if is_run_folder(options.log) else None
    if options.log.is_dir() and folder is None:
        raise LogError(f"{options.log}: no {TLOG_NAME} in this folder; give a run's folder or a file.")
    changed = _changes(options)
    if folder is not None and not changed:
        recording = read_recording(folder)
        _warn_of_versions(recording, console)
        return replay_flight(read_telemetry(folder / TLOG_NAME), recording)
    settings = options.companion
    if folder is not None and settings is None:
        console.print(f"with {', '.join(changed)} the flight's own decisions cannot come again and are not compared")
        settings = settings_file(folder)
    config = companion_settings(settings, options.set, options.detector)
    log = read_log(options.log if folder is None else folder / TLOG_NAME)
    return replay_log(log, config, options.rate)


def _changes(options: Namespace) -> list[str]:
    """Options under which a flight is no longer the one that was flown."""
    given = {
        "--detector": options.detector,
        "--rate": options.rate,
        "--companion": options.companion,
        "--set": options.set or None,
    }
    return [name for name, value in given.items() if value is not None]


def _warn_of_versions(recording: Recording, console: Console) -> None:
    now = versions()
    then = recording.versions
    other = [f"{name} {then[name]}, now {now.get(name)}" for name in then if now.get(name) != then[name]]
    if other:
        console.print(f"flown with other versions, so bits may differ: {'; '.join(other)}")


def _draw(replay: Replay, folder: Path) -> Sequence[str]:
    """A picture for each impact, named in their order."""
    if not replay.findings.impacts:
        return []
    from rebound_cli.replay.picture import draw_impact

    paths = [folder / f"impact-{number}.png" for number in range(1, len(replay.findings.impacts) + 1)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for finding, path in zip(replay.findings.impacts, paths, strict=True):
            draw_impact(replay, finding, path)
    except OSError as error:
        raise ConfigurationError(f"{folder}: the pictures cannot be written there: {error.strerror}.") from error
    return [str(path) for path in paths]


def _exit_code(replay: Replay, expected: int | None, least_watched: float, console: Console) -> int:
    found = len(replay.findings.collisions)
    is_other = replay.reproduction is not None and replay.reproduction.first_difference is not None
    if expected is not None and found != expected:
        console.print(f"expected {expected or 'no'} collisions, found {found}")
        return 1
    share = replay.findings.watched_share
    if expected == 0 and (share is None or share < least_watched):
        seen = "nothing" if share is None else f"{100.0 * share:.0f} %"
        console.print(f"expected no collisions, and {seen} of the flight was watched: that shows none")
        return 1
    return 1 if is_other else 0


def _slug(path: Path) -> str:
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", path.resolve().name.removesuffix(path.suffix)) or "log"
