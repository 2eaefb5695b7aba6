"""Where a rule first matters in a flight, a copy of the whole process flies on without it.

The copy costs the rest of the flight alone, and up to that moment both flights are the same to the bit.
"""

import functools
import importlib
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from bench.ablation.rules import Rule
from bench.campaign.plan import Json


@dataclass(slots=True)
class Copies:
    """Of one flight: in the first process what its copies found, by rule; in a copy the rule that is off."""

    found: dict[str, Json] = field(default_factory=dict)
    off: Rule | None = None
    pipe: int = -1

    def fork(self, rule: Rule) -> None:
        """Return in two processes; in the first one when the copy has ended."""
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            self.off, self.pipe = rule, writing
            return
        os.close(writing)
        with os.fdopen(reading) as pipe:
            text = pipe.read()
        os.waitpid(child, 0)
        self.found[rule.name] = json.loads(text or '{"failure": "the copy died"}')

    def leave(self, find: Callable[[], Json]) -> None:
        """End a copy with what it found; the first process goes on."""
        if self.off is None:
            return
        try:
            os.write(self.pipe, json.dumps(find()).encode())
        finally:
            os._exit(0)


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
        if copies.off is rule:
            rule.forget(arguments)
            return rule.without(arguments, found)
        if copies.off is not None or rule.name in copies.found:
            return found
        other = rule.without(arguments, found)
        if other == found:
            return found
        copies.fork(rule)
        if copies.off is None:
            return found
        rule.forget(arguments)
        return other

    return watched
