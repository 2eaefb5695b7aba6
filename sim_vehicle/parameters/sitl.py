"""Parameters of other people's autopilots, for a SITL that flies the simulated body."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import yaml


@dataclass(frozen=True, slots=True)
class Parameter:
    """One of an autopilot's parameters, with the reason for its value."""

    name: str
    value: int | float
    reason: str

    @property
    def text(self) -> str:
        return str(self.value) if isinstance(self.value, int) else f"{self.value:.5g}"


def same_for_all(autopilot: str, part: str) -> Iterator[Parameter]:
    """What a part of `px4_sitl.yaml` or `ardupilot_sitl.yaml` has: the values that do not depend on the airframe."""
    table = yaml.safe_load((Path(__file__).parent / f"{autopilot}_sitl.yaml").read_text())
    for name, (value, reason) in table[part].items():
        yield Parameter(name, value, reason)
