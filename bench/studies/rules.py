"""The special rules of the companion, each a function whose answer can be left out.

Where a rule first matters in a flight, a copy of the whole process flies on without it. The copy costs the rest of the
flight alone, and up to that moment both flights are the same to the bit.
"""

import functools
import importlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from bench.fly.copies import Copies


@dataclass(frozen=True, slots=True)
class Rule:
    """A function of the companion, and what it would answer if the rule did not exist (see `rules.yaml`)."""

    name: str
    does: str
    place: str
    says: Any = None
    argument: int | None = None
    attribute: str = ""
    forget: Mapping[str, float] = field(default_factory=dict)

    def without(self, arguments: tuple[Any, ...]) -> Any:
        """What is answered without it."""
        if self.argument is not None:
            return arguments[self.argument]
        if self.attribute:
            return getattr(arguments[0], self.attribute)
        # A vector is a tuple.
        return tuple(self.says) or [] if isinstance(self.says, list) else self.says

    def take_back(self, arguments: tuple[Any, ...]) -> None:
        """What the true call has remembered."""
        for name, value in self.forget.items():
            getattr(arguments[0], name).fill(value)


_FILE = Path(__file__).with_name("rules.yaml")
RULES = tuple(Rule(name, **rule) for name, rule in yaml.safe_load(_FILE.read_text("utf-8")).items())


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
    module = importlib.import_module(f"companion.{module_name}")
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
            rule.take_back(arguments)
            return rule.without(arguments)
        if copies.me is not None or rule.name in copies.found:
            return found
        other = rule.without(arguments)
        if other == found or not copies.fork(rule.name):
            return found
        rule.take_back(arguments)
        return other

    return watched
