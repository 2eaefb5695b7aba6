"""`rebound tune`: from healthy flights to what a detector can see on this vehicle, and the settings to fly with."""

import json
from argparse import Namespace

from companion.errors import ConfigurationError
from companion.mission.config import CompanionConfig
from rebound_cli.console import console_for
from rebound_cli.documents import parse_document, validated
from rebound_cli.inputs import load_world
from rebound_cli.progress import with_progress
from rebound_cli.replay.settings import companion_settings
from rebound_cli.tune.healthy import read_healthy
from rebound_cli.tune.hits import sight
from rebound_cli.tune.report import Tuning, tuning_data, tuning_text
from rebound_cli.tune.settings import advise, margins, settings_text

BUILT_IN = ("foldable", "rigid")
# Beside the recorded rate: what a radio or a slow serial port leaves of it, and PX4's default.
RATES_HZ = (100.0, 50.0)


def run_tune(options: Namespace) -> int:
    """Print what the flights say and the settings; with --out write these. Raises LogError, ConfigurationError."""
    console, out = console_for(options.json), options.out
    if out is not None and out.exists():
        raise ConfigurationError(f"{out} exists already: give --out another name.")
    config = companion_settings(options.companion, (), options.detector)
    names = BUILT_IN if options.airframe is None else (options.airframe,)
    airframes = [load_world(None, (), name, None).airframe for name in names]
    flights = [read_healthy(path, config) for path in options.logs]
    logs, recorded_hz = [flight.log for flight in flights], min(flight.shaking.rate_hz for flight in flights)
    # A rate as good as the recorded one shows nothing new.
    rates = [None, *(rate_hz for rate_hz in RATES_HZ if rate_hz < 0.9 * recorded_hz)]
    found = margins(logs, config)
    sights = (sight(logs, config, airframe, rate_hz) for airframe in airframes for rate_hz in rates)
    seen = list(with_progress(sights, len(airframes) * len(rates)))
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
        out.write_text(text, encoding="utf-8")
        console.print(f"\nWritten to {out}. Fly with it: rebound fly MISSION --companion {out} ...")
    return 0
