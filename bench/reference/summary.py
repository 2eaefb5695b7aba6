"""The page of summary.json: the meaning of every key."""

from bench.reference.markdown import MEANINGS, code, table

_TEXT = """# summary.json

One object a flight. `rebound fly MISSION --json` prints the same object on stdout. Times named `_s` count from the
companion's start. Vectors are north, east, down. Positions are in the vehicle's local frame.

## The flight

{flight}
## A collision, by telemetry

{collision}
## The same, by the simulator's truth

{truth}
A recovery is over when the vehicle has been settled for `settled.duration_s`, when the next hit is detected, or 10 s
after the detection.

## Definitions

- A **contact** lasts from the first touch of any part until all parts have been clear for 20 ms. The ground does not
  count.
- A **detection** belongs to a contact that had begun when its sample's averaging window ended, and that had been over
  for no more than 100 ms: velocities show a contact between two samples so late. Each contact explains one detection.
  Any other is a **false detection**.
- A **missed contact** explains no detection.
- A **recontact** is a new contact before the collision before it was recovered from.
"""


def summary_page() -> str:
    parts = {name: table(("key", "meaning"), _rows(MEANINGS[name])) for name in ("flight", "collision", "truth")}
    return _TEXT.format(**parts)


def _rows(keys: dict[str, str]) -> list[tuple[str, str]]:
    return [(code(key), meaning) for key, meaning in keys.items()]
