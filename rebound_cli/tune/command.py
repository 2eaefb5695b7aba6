"""`rebound tune`: from healthy flights to settings."""

import json
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path

from companion.errors import ConfigurationError
from companion.mission.config import CompanionConfig
from rebound_cli.console import console_for, with_progress
from rebound_cli.documents import parse_document, validated
from rebound_cli.inputs import load_world
from rebound_cli.logs.log import Log, LogError
from rebound_cli.logs.reader import read_log
from rebound_cli.logs.shaking import Stage, shaking
from rebound_cli.replay.recording import is_run_folder
from rebound_cli.replay.settings import companion_settings
from rebound_cli.replay.watching import watch_log
from rebound_cli.run_folder import TLOG_NAME
from rebound_cli.tune.crash import crash, told_hits
from rebound_cli.tune.hits import Sight, hit_moments, sight
from rebound_cli.tune.margins import margins
from rebound_cli.tune.report import Healthy, Tuning, tuning_data, tuning_text
from rebound_cli.tune.settings import advise, settings_text
from sim_vehicle.airframe import Airframe

BUILT_IN = ("foldable", "rigid")
# Beside the recorded rate: what a radio or a slow serial port leaves of it, and PX4's default.
RATES_HZ = (100.0, 50.0)


def run_tune(options: Namespace) -> int:
    """Print what the flights say and the settings; with --out write these. Raises LogError, ConfigurationError."""
    console, out = console_for(options.json), options.out
    if out is not None and out.exists():
        raise ConfigurationError(f"{out} exists already: give --out another name.")
    config = companion_settings(options.companion, (), options.detector)
    airframes = [load_world(None, (), name, None).airframe for name in _airframes(options)]
    logs = [_log(path) for path in options.logs]
    flights = [Healthy(log, shaking(log), watch_log(log, config)) for log in logs]
    found = list(margins(logs, config))
    seen = list(with_progress(_sights(logs, config, airframes), len(airframes) * len(_rates(logs))))
    tuning = Tuning(config.detector, flights, found, seen, advise(logs, config, found, seen))
    text = settings_text(tuning.advice, ", ".join(path.name for path in options.logs))
    # Read as `rebound fly` will read it before anybody has it.
    document = parse_document(text, str(out or "the settings"))
    validated(CompanionConfig, document, document.data["companion"], ("companion",))
    if options.json:
        print(json.dumps(tuning_data(tuning), indent=2))
    else:
        console.print(tuning_text(tuning))
        console.print(text.rstrip())
    if out is not None:
        _write(out, text)
        console.print(f"\nWritten to {out}. Fly with it: rebound fly MISSION --companion {out} ...")
    return 0


def _airframes(options: Namespace) -> Sequence[str]:
    return BUILT_IN if options.airframe is None else (options.airframe,)


def _log(path: Path) -> Log:
    log = read_log(path / TLOG_NAME if is_run_folder(path) else path)
    hits = told_hits(path)
    wrong = f"its summary tells {hits} collision{'' if hits == 1 else 's'}" if hits else crash(log)
    if wrong is not None:
        raise LogError(f"{path}: not a healthy flight, {wrong}; tune learns from flights without a hit or a crash.")
    if not any(stage in (Stage.HOVER, Stage.UNDER_WAY) for stage in shaking(log).stages):
        raise LogError(f"{path}: no flight in it, only the ground, a take-off and a landing.")
    if not list(hit_moments(log)):
        raise LogError(f"{path}: too short a flight to learn from; a minute in the air is a good one.")
    return log


def _rates(logs: Sequence[Log]) -> Sequence[float | None]:
    recorded_hz = min(shaking(log).rate_hz for log in logs)
    # A rate as good as the recorded one shows nothing new.
    return [None, *(rate_hz for rate_hz in RATES_HZ if rate_hz < 0.9 * recorded_hz)]


def _sights(logs: Sequence[Log], config: CompanionConfig, airframes: Sequence[Airframe]) -> Iterator[Sight]:
    for airframe in airframes:
        for rate_hz in _rates(logs):
            yield sight(logs, config, airframe, rate_hz)


def _write(out: Path, text: str) -> None:
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigurationError(f"{out} cannot be written: {error.strerror}.") from error
