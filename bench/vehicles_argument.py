"""The option of which vehicles fly, and the document about those that are drawn."""

from argparse import ArgumentParser

DRAWN_NAME, DRAWN_TITLE = "drawn.md", "Vehicles nobody tuned for"


def add_vehicles(parser: ArgumentParser, each: str) -> None:
    parser.add_argument(
        "--vehicles",
        choices=("named", "drawn"),
        default="named",
        help=f"drawn: {each} has a vehicle of its own, drawn from its seed, of both airframes' kinds "
        "(default named: the two airframes)",
    )
