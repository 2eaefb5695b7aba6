"""The mission as it is flown: repeats written out, every step with its number and its policy."""

from collections.abc import Iterator
from dataclasses import dataclass

from companion.mission.items import Action
from companion.mission.model import MOST_STEPS, Mission, MissionItem


@dataclass(frozen=True, slots=True)
class Step:
    """`label` is the item's number as people count, "4.2 (2 of 3)" for the second lap of a repeat.

    `index` is the step's place in the whole program, for taking up an interrupted mission again.
    """

    index: int
    label: str
    item: MissionItem
    action: Action

    @property
    def name(self) -> str:
        return self.item.name


def program(mission: Mission) -> tuple[Step, ...]:
    """All steps in the order in which they are flown. Raises ValueError when they are too many."""
    steps: list[Step] = []
    for label, item in _labelled(mission.items, "", ""):
        steps.append(Step(len(steps), label, item, item.action))
        if len(steps) > MOST_STEPS:
            raise ValueError(f"items: more than {MOST_STEPS} steps once the repeats are written out")
    return tuple(steps)


def _labelled(items: tuple[MissionItem, ...], before: str, lap: str) -> Iterator[tuple[str, MissionItem]]:
    for number, item in enumerate(items, start=1):
        if item.repeat is None:
            yield f"{before}{number}{lap}", item
            continue
        for count in range(1, item.repeat.times + 1):
            yield from _labelled(item.repeat.items, f"{before}{number}.", f"{lap} ({count} of {item.repeat.times})")
