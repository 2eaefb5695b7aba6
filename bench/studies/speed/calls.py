"""How many functions an interval calls, of Python and of C: the same number on every machine, busy or not.

`calls.json` has what they are held to (tests/bench/test_speed.py); `python -m bench speed --calls` makes it anew.
"""

import json
import sys
from pathlib import Path
from types import FrameType
from typing import Any

from bench.studies.speed.flight import fly
from bench.studies.speed.parts import LOG, PARTS, Function, Part, wrapped

HELD_TO = Path(__file__).parent / "calls.json"


def calls_an_interval() -> dict[str, float]:
    """Mean over all intervals of a flight, by part: what it calls itself, without the other parts."""
    counted, intervals, within = {part.name: 0 for part in PARTS}, 0, [""]
    observers = set()

    def count(frame: FrameType, event: str, argument: Any) -> None:
        if event in ("call", "c_call") and within[0] and frame.f_code not in observers:
            counted[within[0]] += 1

    def observed(part: Part, function: Function) -> Function:
        name = part.name

        def run(*arguments: Any, **named: Any) -> Any:
            nonlocal intervals
            outside, within[0] = within[0], name
            try:
                return function(*arguments, **named)
            finally:
                within[0] = outside
                intervals += name == LOG

        observers.add(run.__code__)
        return run

    with wrapped(observed):
        sys.setprofile(count)
        try:
            fly()
        finally:
            sys.setprofile(None)
    return {name: round(calls / intervals, 2) for name, calls in counted.items()}


def held_to() -> dict[str, float]:
    found: dict[str, float] = json.loads(HELD_TO.read_text(encoding="utf-8"))
    return found


def hold_to(calls: dict[str, float]) -> None:
    HELD_TO.write_text(json.dumps(calls, indent=2) + "\n", encoding="utf-8")
