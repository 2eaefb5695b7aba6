"""Which flights are compared, and what each changes in the mission."""

from argparse import Namespace
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from companion.errors import ConfigurationError
from rebound_cli.inputs import inputs


@dataclass(frozen=True, slots=True)
class Case:
    """One flight; None: as the mission has it. `sets` are what `rebound fly` is given by --set."""

    law: str | None
    speed_m_s: float | None
    seed: int
    sets: tuple[str, ...]

    @property
    def group(self) -> str:
        """What differs but the seed."""
        speed = None if self.speed_m_s is None else f"{self.speed_m_s:g}-m-s"
        return "-".join(filter(None, (self.law, speed))) or "as-written"

    @property
    def folder(self) -> str:
        return f"{self.group}-seed-{self.seed}"


def cases_of(options: Namespace) -> list[Case]:
    """Each is a mission and a world that can be flown. Raises ConfigurationError."""
    found = []
    for law, (speed_m_s, sets) in product(options.laws or [None], list(_speeds(options))):
        changed = (*options.set, *sets, *(() if law is None else (f"recovery.law={law}",)))
        document = inputs.load_mission_document(options.mission, changed, options.airframe)
        inputs.mission_from(document, inputs.world_from(document))
        found += [Case(law, speed_m_s, seed, changed) for seed in range(1, options.seeds + 1)]
    return list(dict.fromkeys(found))


def _speeds(options: Namespace) -> Iterator[tuple[float | None, list[str]]]:
    """Each with what it changes: the fastest item's speed, and its acceleration as the square of that, so that the
    vehicle brakes over the distance for which the mission was written.
    """
    if options.speeds is None:
        yield None, []
        return
    document = inputs.load_mission_document(options.mission, options.set)
    inputs.mission_from(document)
    actions = [
        (f"items.{n}.{name}", keys) for n, item in enumerate(document.data["items"]) for name, keys in item.items()
    ]
    with_speed = [(path, keys) for path, keys in actions if isinstance(keys, dict) and keys.get("speed_m_s")]
    if not with_speed:
        raise ConfigurationError(f"--speeds: no item of {options.mission} has a speed_m_s.")
    path, keys = max(with_speed, key=lambda found: float(found[1]["speed_m_s"]))
    for speed_m_s in options.speeds:
        factor = speed_m_s / keys["speed_m_s"]
        scaled = {"speed_m_s": factor, "acceleration_m_s2": factor**2}
        yield speed_m_s, [f"{path}.{key}={keys[key] * by:g}" for key, by in scaled.items() if keys.get(key)]
