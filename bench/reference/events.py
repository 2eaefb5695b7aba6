"""The page of events, from the calls that tell them and the meaning of each kind."""

import ast
from collections.abc import Iterator
from pathlib import Path

from bench.reference.markdown import code, table
from companion.guard.machine import _KINDS
from companion.reflex.classify import TABLE

ROOT = Path(__file__).parents[2]
# What is told under a kind that stands in no call.
ELSEWHERE = frozenset({"late", "lost", "guard", *_KINDS.values()})

MEANINGS = {
    "aborted": "The flight ended early. The vehicle is handed over.",
    "armed": "The vehicle is armed. Mission coordinates count from here.",
    "command": "A command was refused, repeated or not answered.",
    "confirmed": "The guard's OFFBOARD is confirmed by the vehicle.",
    "connected": "A PX4 multicopter was heard.",
    "contact": "A landing or a hand. It is no collision and is not answered.",
    "crash": "The ground was met tilted, or faster than a landing may be.",
    "crossed": "Another program's setpoints reached the vehicle while the guard held it.",
    "damage": "A motor works harder than before the hit: its propeller, or it, may be hurt.",
    "detection": "A collision, on the first message that shows it.",
    "detector": "The detector is armed, with its threshold.",
    "detour": "The item is flown round known obstacles.",
    "disarmed": "The vehicle disarmed.",
    "done": "The mission ended as planned.",
    "enabled": "The guard watches again after it had stood down.",
    "ended": "The guard found no vehicle that it can guard.",
    "envelope": "A setpoint would have left the fence or the limits. The nearest safe one was sent.",
    "estimate": "The vehicle's estimate was reset, is not valid after a hit, or is valid again.",
    "expect": "An expectation of the mission was met or not met.",
    "fault": "An exception in the companion. The vehicle is handed over.",
    "given_back": "The guard gave the vehicle back.",
    "guard": "The guard changed its state for a reason without a kind of its own.",
    "hold": "The vehicle holds after a recovery.",
    "implausible": "A message was refused, or reports of the mode contradict each other.",
    "in_the_way": "Something holds the vehicle up without a hit.",
    "item": "The next mission item begins.",
    "landing": "The vehicle was asked to land.",
    "late": "A step of the real-time loop came late.",
    "not_back": "The guard does not give back what would hit again.",
    "left_alone": "The guard left a hit to another program.",
    "let_go": "The guard stood down: a pilot, a failsafe or another program has the vehicle.",
    "link": "The link or a stream was lost, returned, or is too slow for detection.",
    "loss": "A stream that the detector uses does not arrive.",
    "lost": "The disk refused a part of the log.",
    "mode": "The vehicle's mode changed, or the companion asked for one.",
    "hand_over": "The vehicle rests, the errors of its own estimate are known, and the setpoint is a position again.",
    "obstacle": "A hit was stored in the obstacle map.",
    "by_position": "Recovery by position, as law `paper` has it, with the reason.",
    "plan": "The plan is ready for confirmation.",
    "policy": "What follows the recovery.",
    "rebound": "The rebound was measured and the recovery setpoint adapted.",
    "recovered": "The vehicle came to rest, or the recovery timed out.",
    "refused": "OFFBOARD was refused or not confirmed in time.",
    "resume": "An interrupted mission is flown on.",
    "return": "The vehicle flies to above the arming position.",
    "round_trip": "The TIMESYNC round trip is above its limit, or below it again.",
    "standing_by": "The guard waits for a flight that it may guard.",
    "stopped": "The guard was asked to stop.",
    "streams": "The measured rates of the streams.",
    "take_over": "The guard takes the vehicle over.",
    "takeoff": "Setpoints are sent ahead of the take-off.",
    "timeout": "An item took longer than its `timeout_s`.",
    "unattended": "What PX4 flies if the companion dies, with the vehicle's COM_OF_LOSS_T.",
    "unconfirmed": "A detection was not confirmed. The flight goes on where it was.",
    "unreachable": "Known obstacles leave no way to a goal.",
    "watching": "The guard watches, or stops watching.",
}


def events_page() -> str:
    text = (
        "# Events\n\nEach line of `events.jsonl` is one event: `time_us` (Unix time in microseconds), `kind`, `text` "
    )
    text += "for people and `data`\nfor programs. `CollisionGuard.watch_events()` gives the same.\n\n"
    told = data_keys()
    rows = [(code(kind), meaning, ", ".join(map(code, told.get(kind, ())))) for kind, meaning in MEANINGS.items()]
    kinds = [(row.kind.value, row.criterion) for row in TABLE]
    text += table(("kind", "meaning", "data"), rows) + "\n\n## Kinds of impact\n\nThe first row that holds counts.\n\n"
    return text + table(("kind", "criterion"), kinds)


def data_keys() -> dict[str, list[str]]:
    """Of each kind that a call in the companion tells the keys of its data."""
    found: dict[str, list[str]] = {}
    for path in sorted((ROOT / "companion").rglob("*.py")):
        for call in _calls(ast.parse(path.read_text(encoding="utf-8"))):
            at = {"report": 1, "Notice": 0}[_name(call)]
            kind = call.args[at] if len(call.args) > at else None
            if isinstance(kind, ast.Constant) and isinstance(kind.value, str):
                keys = found.setdefault(kind.value, [])
                keys += [word.arg for word in call.keywords if word.arg and word.arg not in keys]
    return found


def _calls(tree: ast.AST) -> Iterator[ast.Call]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and _name(node) in ("report", "Notice"):
            yield node


def _name(call: ast.Call) -> str:
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
