"""The special rules of the companion, each a function whose answer can be left out.

Where a rule first matters in a flight, a copy of the whole process flies on without it. The copy costs the rest of the
flight alone, and up to that moment both flights are the same to the bit.
"""

import functools
import importlib
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from bench.fly.copies import Copies
from companion.motion.vector import ZERO

Arguments = tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Rule:
    """A function of the companion, and what it would answer if the rule did not exist.

    `place` is "module:function" or "module:Class.method"; a property is a method, too. `without` gets the arguments and
    the true answer. `forget` takes back what the true call has remembered.
    """

    name: str
    does: str
    place: str
    without: Callable[[Arguments, Any], Any]
    forget: Callable[[Arguments], None] = lambda arguments: None


def _says(answer: Any) -> Callable[[Arguments, Any], Any]:
    return lambda arguments, found: answer


def _argument(number: int) -> Callable[[Arguments, Any], Any]:
    return lambda arguments, found: arguments[number]


_REFLEX, _FLIGHT = "companion.reflex.", "companion.flight."

RULES = (
    Rule(
        "velocity jump",
        "a velocity that the accelerometer does not explain is a hit",
        _REFLEX + "velocity_jump:VelocityJump.step_m_s",
        _says(None),
    ),
    Rule(
        "hand",
        "a soft force on a hovering vehicle waits",
        _REFLEX + "fused:FusedState.may_be_hand",
        _says(False),
    ),
    Rule(
        "turning drag",
        "a turning vehicle needs more force for a hit",
        _REFLEX + "fused:FusedState.side_threshold_m_s2",
        lambda arguments, found: arguments[0].threshold_m_s2,
    ),
    Rule(
        "second sample",
        "a weak force shows in two samples together",
        _REFLEX + "fused:FusedState._together_m_s2",
        _says(0.0),
    ),
    Rule(
        "leaning",
        "thrust that moves nothing is a hit",
        _REFLEX + "sustained_force:SustainedForceMonitor.step",
        _says(None),
    ),
    Rule(
        "attitude by rates",
        "no clipped attitude",
        _REFLEX + "correction:VelocityValidity.tilt_error_rad",
        _says(0.0),
    ),
    Rule(
        "trust",
        "a larger velocity jump while a hit is corrected",
        _REFLEX + "correction:VelocityValidity.correction_m_s",
        _says(0.0),
    ),
    Rule("change", "the normal by the change of velocity", _REFLEX + "collision:with_change", _argument(0)),
    Rule("held off", "no attitude that leads into what is near", _REFLEX + "attitude_law:held_off", _argument(0)),
    Rule(
        "leaves",
        "no vehicle goes on into what it has hit",
        _REFLEX + "motion_estimator:FilterBank.leave",
        _says(None),
        lambda arguments: arguments[0].leaves.fill(1.0),
    ),
    Rule(
        "known rest",
        "what is missing still is known and asked for",
        _REFLEX + "motion_estimator:FilterBank.mean_error",
        _says(ZERO),
    ),
    Rule(
        "velocity by places",
        "no velocity that the places deny",
        _REFLEX + "motion_estimator:_rate_error",
        _says(ZERO),
    ),
    Rule("remembered surfaces", "keeps off what it knows", _FLIGHT + "obstacle_map:remembered_surfaces", _says([])),
)


@contextmanager
def switched(rules: Sequence[Rule]) -> Iterator[Copies]:
    """The companion with every rule watched, while this lasts."""
    copies, undo = Copies(), list[tuple[Any, str, Any]]()
    try:
        for rule in rules:
            for owner, name in _places(rule):
                undo.append((owner, name, vars(owner)[name]))
                setattr(owner, name, _watched(rule, copies, vars(owner)[name]))
        yield copies
    finally:
        for owner, name, original in reversed(undo):
            setattr(owner, name, original)


def _places(rule: Rule) -> list[tuple[Any, str]]:
    """The class of a method; of a function every module of the companion that calls it."""
    module_name, _, path = rule.place.partition(":")
    module = importlib.import_module(module_name)
    owner_name, _, name = path.rpartition(".")
    if owner_name:
        return [(getattr(module, owner_name), name)]
    function = getattr(module, name)
    modules = [each for key, each in sys.modules.items() if key.split(".")[0] == "companion"]
    return [(each, name) for each in modules if vars(each).get(name) is function]


def _watched(rule: Rule, copies: Copies, original: Any) -> Any:
    if isinstance(original, property):
        assert original.fget is not None
        return property(_watched(rule, copies, original.fget))

    @functools.wraps(original)
    def watched(*arguments: Any) -> Any:
        found = original(*arguments)
        if copies.me == rule.name:
            rule.forget(arguments)
            return rule.without(arguments, found)
        if copies.me is not None or rule.name in copies.found:
            return found
        other = rule.without(arguments, found)
        if other == found:
            return found
        if not copies.fork(rule.name):
            return found
        rule.forget(arguments)
        return other

    return watched
