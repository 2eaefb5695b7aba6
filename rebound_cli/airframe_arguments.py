"""The arguments of `rebound airframe`."""

from rebound_cli.arguments import Commands, runs


def add_airframe(commands: Commands) -> None:
    airframe = commands.add_parser(
        "airframe",
        help="print an airframe for PX4",
        description="PX4's parameters for one of our airframes, on standard output.",
    )
    airframe.add_argument("target", choices=("px4",), help="for whom")
    airframe.add_argument("--airframe", default="foldable", metavar="NAME|FILE", help="default: foldable")
    airframe.add_argument(
        "--position",
        choices=("mocap", "gps", "flow"),
        default="mocap",
        help="what PX4 flies by: motion capture, as indoors (default), an RTK GPS, or optical flow and a range finder",
    )
    airframe.add_argument(
        "--format",
        choices=("env", "params", "airframe"),
        default="env",
        help="env: exports that PX4 SITL reads at start (default); params: for QGroundControl; airframe: for PX4",
    )
    airframe.set_defaults(run=runs("rebound_cli.airframe:run_airframe"))
