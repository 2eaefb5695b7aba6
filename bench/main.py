"""The command `python -m bench`: the paper's studies, detectors on their bench, random missions, faults."""

import math
import os
import shlex
import sys
from argparse import SUPPRESS, ArgumentParser
from collections.abc import Sequence
from pathlib import Path

from rebound_cli.arguments import Commands, count, number, runs
from rebound_cli.main import run

# Studies that were, and what shows now what they showed.
GONE = {
    "campaign page": "`bench campaign` writes the page, and the rows beside it",
    "campaign recoveries": "`bench hits` and `bench ablation` measure recoveries",
    "corpus": "`bench hits --verdicts` and `bench detectors` judge a version on the same seeds",
    "paper results": "`bench paper` has the flight tests by speed and airframe",
    "soak": "hours as a service are no study any more",
}
hours = number(float, math.ulp(0.0), 10_000, "a time: give hours, such as 0.5")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one study and return its exit code."""
    words = sys.argv[1:] if arguments is None else arguments
    for gone, instead in GONE.items():
        if [*words][: len(gone.split())] == gone.split():
            print(f"bench: `{gone}` is no more: {instead}.", file=sys.stderr)
            return 2
    options = build_parser().parse_args(words)
    options.typed = shlex.join(("python", "-m", "bench", *words))
    for gone, instead in vars(options).get("gone", {}).items():
        if getattr(options, gone):
            print(f"--{gone} is no more: {instead}.", file=sys.stderr)
    return run(options, "bench")


def build_parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog="python -m bench", description="Studies of Rebound and their tables; needs a checkout and its environment."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="command")
    _add_drawn(commands)
    _add_flights(commands)
    _add_faults(commands)
    _add_others(commands)
    _add_manual(commands)
    return parser


def _study(commands: Commands, name: str, place: str, does: str, more: str) -> ArgumentParser:
    """A command whose function is at the place."""
    parser = commands.add_parser(name, help=does, description=more)
    parser.set_defaults(run=runs(place))
    return parser


def _add_count(parser: ArgumentParser, name: str, default: int, text: str, metavar: str = "N") -> None:
    parser.add_argument(name, type=count, default=default, metavar=metavar, help=f"{text} (default %(default)s)")


def _add_out(parser: ArgumentParser, name: str) -> None:
    text = f"folder of the page {name}.md and what belongs to it, or the page itself (default: build/{name})"
    parser.add_argument("--out", type=Path, metavar="DIR", help=text)


def _add_rows(parser: ArgumentParser, out: str) -> None:
    """Of a study whose rows are single flights."""
    _add_seed(parser)
    parser.add_argument("--jobs", type=count, default=1, help="processes (default 1)")
    text = "a JSON line a flight (default: %(default)s)"
    parser.add_argument("--out", type=Path, default=Path(out), metavar="FILE", help=text)


def _add_seed(parser: ArgumentParser, default: int = 1) -> None:
    _add_count(parser, "--first-seed", default, "of the first case; the others follow", "SEED")


def _add_jobs(parser: ArgumentParser) -> None:
    parser.add_argument("--jobs", type=count, default=os.cpu_count() or 1, help="processes (default: one a core)")


def _add_workers(parser: ArgumentParser) -> None:
    """For what is worked out on Dask: here, or wherever a scheduler has workers."""
    _add_jobs(parser)
    text = "a Dask scheduler whose workers do the work, e.g. tcp://10.0.0.7:8786"
    parser.add_argument("--scheduler", metavar="ADDRESS", help=text)


def _add_vehicles(parser: ArgumentParser, each: str) -> None:
    text = f"drawn: {each} has a vehicle of its own, drawn from its seed, of both airframes' kinds "
    text += "(default named: the two airframes)"
    parser.add_argument("--vehicles", choices=("named", "drawn"), default="named", help=text)


def _add_drawn(commands: Commands) -> None:
    """Of vehicles and worlds drawn from seeds."""
    text = "Hits on walls and poles by vehicles that begin in flight, guarded through the whole wire."
    does = "fly hits alone, from just before each to rest, and write which were missed"
    hits = _study(commands, "hits", "bench.studies.hits:run_hits", does, text)
    _add_count(hits, "--hits", 1000, "so many")
    _add_seed(hits)
    _add_vehicles(hits, "every hit")
    _add_workers(hits)
    text = "fly each hit only until the guard tells of it, dozens from one approach: a million an hour"
    hits.add_argument("--verdicts", action="store_true", help=text)
    hits.add_argument("--growth", action="store_true", help=SUPPRESS)
    _add_out(hits, "hits")
    hits.set_defaults(gone={"growth": "each row says what its hit cost"})

    text = "Random missions with both airframes. Rows are kept: a broken-off run goes on."
    does = "fly random missions in random rooms and write what became of them"
    campaign = _study(commands, "campaign", "bench.studies.campaign:run_missions", does, text)
    _add_count(campaign, "--missions", 1000, "random missions")
    _add_seed(campaign)
    _add_vehicles(campaign, "every mission")
    _add_workers(campaign)
    text = "fly this one mission again and keep its whole run folder, by default runs/<time>-random-SEED"
    campaign.add_argument("--only", type=count, metavar="SEED", help=text)
    text = "with --only, which of its two flights (default foldable)"
    campaign.add_argument("--airframe", choices=("foldable", "rigid"), help=text)
    _add_out(campaign, "campaign")

    text = "Simulated hits and healthy flights through every detector."
    does = "try every collision detector on hits and healthy flights"
    detectors = _study(commands, "detectors", "bench.studies.detectors:run_detectors", does, text)
    _add_count(detectors, "--hits", 400, "simulated hits")
    text = "hours of simulated healthy flight (default %(default)s)"
    detectors.add_argument("--hours", type=hours, default=0.5, metavar="H", help=text)
    _add_seed(detectors, 0)
    _add_vehicles(detectors, "every case")
    _add_workers(detectors)
    _add_out(detectors, "detection")

    from bench.studies.rules import RULES

    text = "Where a rule first matters in a flight, a copy of the flight goes on without it; by the truth."
    does = "fly drawn vehicles with and without each special rule of the companion, and write what each is worth"
    ablation = _study(commands, "ablation", "bench.studies.ablation:run_ablation", does, text)
    _add_count(ablation, "--missions", 100, "of each kind")
    _add_seed(ablation)
    names = tuple(rule.name for rule in RULES)
    text = f"one of: {', '.join(names)} (default: all)"
    ablation.add_argument("--rule", action="append", choices=names, metavar="NAME", help=text)
    ablation.add_argument("--hits", type=count, help=SUPPRESS)
    ablation.set_defaults(gone={"hits": "`bench detectors` has the detector alone"})
    _add_workers(ablation)
    _add_out(ablation, "ablation")


def _add_flights(commands: Commands) -> None:
    """Of flights without a hit: recorded ones, by hand, to the ground."""
    text = "Every log of some folders through the detector: hours watched, events, the rate of false alarms."
    flights = _study(commands, "flights", "bench.studies.flights:run_flights", "a corpus of recorded flights", text)
    flights.add_argument("folders", metavar="FOLDER", nargs="+", type=Path, help="searched for .ulg, .bin, .log, .tlog")
    text = "what happened when, as YAML: log, seconds, class (default: those of the public logs that were looked at)"
    flights.add_argument("--labels", metavar="FILE", type=Path, help=text)
    text = "HIGHRES_IMU as if asked of PX4 for this rate (default: as recorded)"
    flights.add_argument("--rate", metavar="HZ", type=float, help=text)
    _add_out(flights, "flights")

    text = "Full deflections, reversals, 30 to 45 degrees of tilt, gusts; one minute a flight."
    does = "fly drawn vehicles hard by hand, and count what is reported"
    hand = _study(commands, "hand", "bench.studies.hand:run_hand", does, text)
    _add_count(hand, "--flights", 300, "at each IMU rate")
    text = "sticks of the real logs in it in every second flight"
    hand.add_argument("--logs", type=Path, metavar="FOLDER", help=text)
    _add_rows(hand, "build/hand.jsonl")

    text = "Landings by AUTO.LAND, RTL, a mission and sticks at 0.2 to 2 m/s on soft and hard ground: none is a "
    text += "collision. Falls from 1 to 3 m at any tilt: each is a crash."
    does = "land and drop drawn vehicles, and write what is reported of the ground"
    landings = _study(commands, "landings", "bench.studies.landings:run_landings", does, text)
    _add_count(landings, "--landings", 500, "so many")
    _add_count(landings, "--falls", 200, "so many")
    _add_rows(landings, "build/landings.jsonl")


def _add_faults(commands: Commands) -> None:
    text = "Wall hits at 0.7 to 5 m/s; the companion is killed from 0.3 s before to 1.5 s after the touch."
    does = "kill the companion at random instants around a hit, and see the vehicle land"
    kills = _study(commands, "kills", "bench.studies.kills:run_kills", does, text)
    _add_count(kills, "--kills", 1000, "so many kills")
    _add_seed(kills)
    _add_out(kills, "kills")
    _add_workers(kills)

    text = "Flights into a wall with a fault each; see docs/reference/faults.md. A broken-off run goes on where it was."
    does = "inject faults and attacks into flights and write what became of them"
    faults = _study(commands, "faults", "bench.studies.faults:run_faults", does, text)
    _add_count(faults, "--seeds", 50, "flights of each fault")
    faults.add_argument("--only", metavar="NAME", help="print the flights of this fault and write nothing")
    _add_jobs(faults)
    faults.add_argument("--hits", type=count, help=SUPPRESS)
    _add_out(faults, "faults")
    faults.set_defaults(gone={"hits": "`python -m bench speed --latency HITS` measures hits under load"})


def _add_others(commands: Commands) -> None:
    text = "The paper's figures and numbers beside ours, flown in lockstep."
    does = "fly the paper's studies and write figures and tables"
    paper = _study(commands, "paper", "bench.studies.paper.command:run_paper", does, text)
    _add_out(paper, "paper")
    # Chosen so that all of it takes less than five minutes on two cores.
    _add_count(paper, "--seeds", 6, "walls from any side: flights at each speed")
    _add_jobs(paper)

    text = "wall.yaml in lockstep, bytes both ways, log on, one core; see docs/explanation/performance.md."
    does = "measure the lockstep loop: times real time, and what each part of an interval costs"
    speed = _study(commands, "speed", "bench.studies.speed.study:run_speed", does, text)
    _add_count(speed, "--flights", 10, "best and worst of so many")
    _add_out(speed, "speed")
    text = "count function calls alone, and make what the count is held to anew"
    speed.add_argument("--calls", action="store_true", help=text)
    text = "measure in real time how soon so many hits are answered; nothing else"
    speed.add_argument("--latency", type=count, metavar="HITS", help=text)


def _add_manual(commands: Commands) -> None:
    text = "Flies into a wall and makes the manual's pictures of it: the flight's figure, the hit as an animation, the "
    text += "report as a browser shows it. Stamps the pages that show them. Needs Chromium."
    pictures = _study(commands, "pictures", "bench.pictures.command:run_pictures", "make the manual's pictures", text)
    text = "folder of README.md and docs (default: here)"
    pictures.add_argument("--out", type=Path, default=Path("."), metavar="DIR", help=text)

    text = "Models, arguments, state tables and docstrings as the pages of docs/reference."
    does = "write the generated pages of the manual"
    docs = _study(commands, "docs", "bench.reference.command:run_docs", does, text)
    text = "write nothing; exit 1 where a page is not up to date"
    docs.add_argument("--check", action="store_true", help=text)

    text = "Lists pictures and figures of the manual that are older than the code they speak of, or bear no stamp."
    does = "look for pictures and figures that are out of date"
    stamps = _study(commands, "stamps", "bench.stamps:run_stamps", does, text)
    stamps.add_argument("--release", action="store_true", help="exit 1 where there is one")
