"""The card of the first flight, to be printed: what preflight has found, and the steps to the first hit."""

import textwrap
from collections.abc import Sequence

from companion.autopilot.setup import PreflightItem, Verdict
from companion.preflight import Survey

_WIDTH = 100
_CARD = """FIRST FLIGHT WITH REBOUND

{vehicle}
Link {connect}

OPEN ITEMS
{items}

IF THE COMPANION DIES
{dies}

HOW THE PILOT TAKES OVER
Choose another mode, or move a stick by more than 30 %. Rebound lets go and stays away until the vehicle is disarmed.

BEFORE, PROPELLERS OFF
[ ] `rebound status` says "standing by".
[ ] Arm by radio, choose position mode and back, disarm: each shows in `rebound status`.
[ ] Guards whole and tight. Nothing loose that could reach a propeller.

FLIGHT 1, NO HIT
[ ] Free space of 5 m on every side, nobody inside. One person at the radio, with the mode switch in hand.
[ ] The guard is stopped. Take off by radio, hold 1.5 m high, run `rebound preflight`, look at "vibration". Land.
[ ] The guard runs. Take off again, hold for a minute: `rebound status` says "watching". Land.
[ ] `rebound logs show`: no hit is told.

FLIGHT 2, THE FIRST HIT
[ ] A line of 3 m from the vehicle's middle to a weight on the ground, clear of the propellers.
[ ] Something soft and upright to hit, such as a mattress; nobody behind it.
[ ] Hold 1.5 m high, fly against it at walking pace, below 1 m/s, and let go of the sticks.
[ ] It comes to rest before the obstacle and holds. Land at once.
[ ] Turn each propeller by hand: no chip, no wobble, no play. Guards and arms whole.
[ ] `rebound logs show`: one hit, on the right side, as fast as it was flown.

Not as written here? Land, and keep the flight: rebound logs export
"""


def card(survey: Survey, found: Sequence[PreflightItem], connect: str) -> str:
    vehicle = survey.vehicle
    kind = "vehicle" if vehicle.identity is None else vehicle.identity.vehicle_type
    battery = "unknown" if vehicle.battery_percent is None else f"{vehicle.battery_percent} %"
    wrong = [finding for finding in found if finding.verdict is not Verdict.GOOD]
    items = [f"[ ] {one.verdict.value}: {one.item}: {one.found} -> {one.remedy}" for one in wrong]
    text = _CARD.format(
        vehicle=f"{vehicle.autopilot_text()}, {kind}, battery {battery}",
        connect=connect,
        items="\n".join(items) or "none",
        dies=vehicle.autopilot.loss_text(survey.parameters),
    )
    return "".join(_wrapped(line) for line in text.splitlines())


def _wrapped(line: str) -> str:
    indent = "    " if line.startswith("[") else ""
    return "\n".join(textwrap.wrap(line, _WIDTH, subsequent_indent=indent) or [""]) + "\n"
