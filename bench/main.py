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

hours = number(float, math.ulp(0.0), 10_000, "a time: give hours, such as 0.5")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one study and return its exit code."""
    words = sys.argv[1:] if arguments is None else arguments
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
    _add_paper(commands)
    _add_detectors(commands)
    _add_campaign(commands)
    _add_ablation(commands)
    _add_flights(commands)
    _add_hits(commands)
    _add_hand(commands)
    _add_landings(commands)
    _add_faults(commands)
    _add_service(commands)
    _add_manual(commands)
    return parser


def _add_out(parser: ArgumentParser, name: str) -> None:
    text = f"folder of the page {name}.md and what belongs to it, or the page itself (default: build/{name})"
    parser.add_argument("--out", type=Path, metavar="DIR", help=text)


def _add_workers(parser: ArgumentParser) -> None:
    """For what is worked out on Dask: here, or wherever a scheduler has workers."""
    _add_jobs(parser)
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="a Dask scheduler whose workers do the work, e.g. tcp://10.0.0.7:8786"
    )


def _add_jobs(parser: ArgumentParser) -> None:
    parser.add_argument("--jobs", type=count, default=os.cpu_count() or 1, help="processes (default: one a core)")


def _add_seed(parser: ArgumentParser, default: int = 1) -> None:
    text = f"of the first case; the others follow (default {default})"
    parser.add_argument("--first-seed", type=count, default=default, metavar="SEED", help=text)


def _add_vehicles(parser: ArgumentParser, each: str) -> None:
    parser.add_argument(
        "--vehicles",
        choices=("named", "drawn"),
        default="named",
        help=f"drawn: {each} has a vehicle of its own, drawn from its seed, of both airframes' kinds "
        "(default named: the two airframes)",
    )


def _add_paper(commands: Commands) -> None:
    text = "The paper's figures and numbers beside ours, flown in lockstep."
    paper = commands.add_parser("paper", help="fly the paper's studies and write figures and tables", description=text)
    _add_out(paper, "paper")
    # Chosen so that all of it takes less than five minutes on two cores.
    paper.add_argument("--seeds", type=count, default=6, help="walls from any side: flights at each speed (default 6)")
    _add_jobs(paper)
    paper.set_defaults(run=runs("bench.studies.paper.command:run_paper"))


def _add_detectors(commands: Commands) -> None:
    text = "Simulated hits and healthy flights through every detector."
    detectors = commands.add_parser(
        "detectors", help="try every collision detector on hits and healthy flights", description=text
    )
    detectors.add_argument("--hits", type=count, default=400, metavar="N", help="simulated hits (default 400)")
    detectors.add_argument(
        "--hours", type=hours, default=0.5, metavar="H", help="hours of simulated healthy flight (default 0.5)"
    )
    _add_seed(detectors, 0)
    _add_vehicles(detectors, "every case")
    _add_workers(detectors)
    _add_out(detectors, "detection")
    detectors.set_defaults(run=runs("bench.studies.detectors:run_detectors"))


def _add_campaign(commands: Commands) -> None:
    text = "Random missions with both airframes. Rows are kept: a broken-off run goes on."
    campaign = commands.add_parser(
        "campaign", help="fly random missions in random rooms and write what became of them", description=text
    )
    campaign.add_argument("--missions", type=count, default=1000, metavar="N", help="random missions (default 1000)")
    _add_seed(campaign)
    _add_vehicles(campaign, "every mission")
    _add_workers(campaign)
    text = "fly this one mission again and keep its whole run folder, by default runs/<time>-random-SEED"
    campaign.add_argument("--only", type=count, metavar="SEED", help=text)
    text = "with --only, which of its two flights (default foldable)"
    campaign.add_argument("--airframe", choices=("foldable", "rigid"), help=text)
    _add_out(campaign, "campaign")
    campaign.set_defaults(run=runs("bench.studies.campaign:run_missions"))


def _add_ablation(commands: Commands) -> None:
    from bench.studies.rules import RULES

    ablation = commands.add_parser(
        "ablation",
        help="fly drawn vehicles with and without each special rule of the companion, and write what each is worth",
        description="Where a rule first matters in a flight, a copy of the flight goes on without it; by the truth.",
    )
    ablation.add_argument("--missions", type=count, default=100, metavar="N", help="of each kind (default 100)")
    _add_seed(ablation)
    names = tuple(rule.name for rule in RULES)
    ablation.add_argument(
        "--rule", action="append", choices=names, metavar="NAME", help=f"one of: {', '.join(names)} (default: all)"
    )
    _add_out(ablation, "ablation")
    text = "drawn hits for the detector alone, with hands and flights"
    ablation.add_argument("--hits", type=count, metavar="N", help=text)
    _add_workers(ablation)
    ablation.set_defaults(run=runs("bench.studies.ablation:run_ablation"))


def _add_flights(commands: Commands) -> None:
    text = "Every log of some folders through the detector: hours watched, events, the rate of false alarms."
    flights = commands.add_parser("flights", help="a corpus of recorded flights", description=text)
    flights.add_argument("folders", metavar="FOLDER", nargs="+", type=Path, help="searched for .ulg, .bin, .log, .tlog")
    text = "what happened when, as YAML: log, seconds, class (default: those of the public logs that were looked at)"
    flights.add_argument("--labels", metavar="FILE", type=Path, help=text)
    text = "HIGHRES_IMU as if asked of PX4 for this rate (default: as recorded)"
    flights.add_argument("--rate", metavar="HZ", type=float, help=text)
    text = "folder of table and pictures (default: build/flights)"
    flights.add_argument("--out", metavar="DIR", type=Path, default=Path("build/flights"), help=text)
    flights.set_defaults(run=runs("bench.studies.flights:run_flights"))


def _add_hits(commands: Commands) -> None:
    hits = commands.add_parser(
        "hits",
        help="fly hits alone, from just before each to rest, and write which were missed",
        description="Hits on walls and poles by vehicles that begin in flight, guarded through the whole wire.",
    )
    hits.add_argument("--hits", type=count, default=1000, metavar="N", help="default 1000")
    _add_seed(hits)
    _add_vehicles(hits, "every hit")
    _add_workers(hits)
    hits.add_argument(
        "--verdicts",
        action="store_true",
        help="fly each hit only until the guard tells of it, dozens from one approach: a million an hour",
    )
    hits.add_argument("--growth", action="store_true", help=SUPPRESS)
    _add_out(hits, "hits")
    gone = {"growth": "each row says what its hit cost"}
    hits.set_defaults(run=runs("bench.studies.hits:run_hits"), gone=gone)


def _add_hand(commands: Commands) -> None:
    hand = commands.add_parser(
        "hand",
        help="fly drawn vehicles hard by hand, and count what is reported",
        description="Full deflections, reversals, 30 to 45 degrees of tilt, gusts; one minute a flight.",
    )
    hand.add_argument("--flights", type=count, default=300, metavar="N", help="at each IMU rate (default 300)")
    text = "sticks of the real logs in it in every second flight"
    hand.add_argument("--logs", type=Path, metavar="FOLDER", help=text)
    _add_rows(hand, Path("build/hand.jsonl"))
    hand.set_defaults(run=runs("bench.studies.hand:run_hand"))


def _add_landings(commands: Commands) -> None:
    landings = commands.add_parser(
        "landings",
        help="land and drop drawn vehicles, and write what is reported of the ground",
        description="Landings by AUTO.LAND, RTL, a mission and sticks at 0.2 to 2 m/s on soft and hard ground: none is "
        "a collision. Falls from 1 to 3 m at any tilt: each is a crash.",
    )
    landings.add_argument("--landings", type=count, default=500, metavar="N", help="default 500")
    landings.add_argument("--falls", type=count, default=200, metavar="N", help="default 200")
    _add_rows(landings, Path("build/landings.jsonl"))
    landings.set_defaults(run=runs("bench.studies.landings:run_landings"))


def _add_rows(parser: ArgumentParser, out: Path) -> None:
    """Of a study whose rows are single flights."""
    _add_seed(parser)
    parser.add_argument("--jobs", type=count, default=1, help="processes (default 1)")
    text = "a JSON line a flight (default: %(default)s)"
    parser.add_argument("--out", type=Path, default=out, metavar="FILE", help=text)


def _add_faults(commands: Commands) -> None:
    text = "Wall hits at 0.7 to 5 m/s; the companion is killed from 0.3 s before to 1.5 s after the touch."
    kills = commands.add_parser(
        "kills", help="kill the companion at random instants around a hit, and see the vehicle land", description=text
    )
    kills.add_argument("--kills", type=count, default=1000, metavar="N", help="so many kills (default 1000)")
    _add_seed(kills)
    _add_out(kills, "kills")
    _add_workers(kills)
    kills.set_defaults(run=runs("bench.studies.kills:run_kills"))
    faults = commands.add_parser(
        "faults",
        help="inject faults and attacks into flights and write what became of them",
        description="Flights into a wall with a fault each, and files that mean harm; see docs/reference/faults.md. "
        "A broken-off run goes on where it was.",
    )
    faults.add_argument("--seeds", type=count, default=50, metavar="N", help="flights of each fault (default 50)")
    faults.add_argument("--only", metavar="NAME", help="print the flights of this fault and write nothing")
    _add_jobs(faults)
    faults.add_argument("--hits", type=count, help=SUPPRESS)
    _add_out(faults, "faults")
    gone = {"hits": "`python -m bench speed --latency HITS` measures hits under load"}
    faults.set_defaults(run=runs("bench.studies.faults:run_faults"), gone=gone)


def _add_service(commands: Commands) -> None:
    speed = commands.add_parser(
        "speed",
        help="measure the lockstep loop: times real time, and what each part of an interval costs",
        description="wall.yaml in lockstep, bytes both ways, log on, one core; see docs/explanation/performance.md.",
    )
    speed.add_argument("--flights", type=count, default=10, metavar="N", help="best and worst of so many (default 10)")
    _add_out(speed, "speed")
    text = "count function calls alone, and make what the count is held to anew"
    speed.add_argument("--calls", action="store_true", help=text)
    text = "measure in real time how soon so many hits are answered; nothing else"
    speed.add_argument("--latency", type=count, metavar="HITS", help=text)
    speed.set_defaults(run=runs("bench.studies.speed.study:run_speed"))


def _add_manual(commands: Commands) -> None:
    text = "Flies into a wall and makes the manual's pictures of it: the flight's figure, the hit as an animation, the "
    text += "report as a browser shows it. Stamps the pages that show them. Needs Chromium."
    pictures = commands.add_parser("pictures", help="make the manual's pictures", description=text)
    out = "folder of README.md and docs (default: here)"
    pictures.add_argument("--out", type=Path, default=Path("."), metavar="DIR", help=out)
    pictures.set_defaults(run=runs("bench.pictures.command:run_pictures"))
    text = "Models, arguments, state tables and docstrings as the pages of docs/reference."
    docs = commands.add_parser("docs", help="write the generated pages of the manual", description=text)
    docs.add_argument("--check", action="store_true", help="write nothing; exit 1 where a page is not up to date")
    docs.set_defaults(run=runs("bench.reference.command:run_docs"))
    text = "Lists pictures and figures of the manual that are older than the code they speak of, or bear no stamp."
    stamps = commands.add_parser("stamps", help="look for pictures and figures that are out of date", description=text)
    stamps.add_argument("--release", action="store_true", help="exit 1 where there is one")
    stamps.set_defaults(run=runs("bench.stamps:run_stamps"))
