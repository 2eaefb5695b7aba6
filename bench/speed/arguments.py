"""The arguments of `bench speed`."""

from pathlib import Path

from rebound_cli.arguments import Commands, count, runs


def add_speed(commands: Commands) -> None:
    speed = commands.add_parser(
        "speed",
        help="measure the lockstep loop: times real time, and what each part of an interval costs",
        description="wall.yaml in lockstep, bytes both ways, log on, one core; see docs/explanation/performance.md.",
    )
    speed.add_argument("--flights", type=count, default=10, metavar="N", help="best and worst of so many (default 10)")
    speed.add_argument(
        "--out",
        type=Path,
        default=Path("build/performance.md"),
        metavar="FILE",
        help="default: build/performance.md",
    )
    speed.add_argument(
        "--calls", action="store_true", help="count function calls alone, and make what the count is held to anew"
    )
    speed.add_argument(
        "--latency",
        type=count,
        metavar="HITS",
        help="measure in real time, beside pymavlink and MAVSDK 4, how soon so many hits are answered; nothing else",
    )
    speed.add_argument(
        "--px4",
        type=count,
        metavar="PORT",
        help="wait at this TCP port for a PX4 SITL that somebody starts, and measure its lockstep; nothing else",
    )
    speed.add_argument(
        "--sensor-rate", type=count, default=1000, metavar="HZ", help="of the samples to that PX4 (default 1000)"
    )
    speed.set_defaults(run=runs("bench.speed.command:run_speed"))
