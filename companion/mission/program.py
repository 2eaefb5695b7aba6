"""The mission as it is flown: repeats written out, every step with its number and its policy."""

from collections.abc import Iterator
from dataclasses import dataclass

from companion.mission.items import Action
from companion.mission.model import MOST_STEPS, Mission, MissionItem


@dataclass(frozen=True, slots=True)
class Step:
    """`label` is the item's number as people count, "4.2 (2 of 3)" for the second lap of a repeat."""

    label: str
    item: MissionItem
    action: Action

    @property
    def name(self) -> str:
        return self.item.name


def program(mission: Mission) -> tuple[Step, ...]:
    """All steps in the order in which they are flown. Raises ValueError when they are too many."""
    steps = []
    for step in _steps(mission.items, "", ""):
        steps.append(step)
        if len(steps) > MOST_STEPS:
            raise ValueError(f"items: more than {MOST_STEPS} steps once the repeats are written out")
    return tuple(steps)


def _steps(items: tuple[MissionItem, ...], before: str, lap: str) -> Iterator[Step]:
    for number, item in enumerate(items, start=1):
        if item.repeat is None:
            yield Step(f"{before}{number}{lap}", item, item.action)
            continue
        for count in range(1, item.repeat.times + 1):
            yield from _steps(item.repeat.items, f"{before}{number}.", f"{lap} ({count} of {item.repeat.times})")
