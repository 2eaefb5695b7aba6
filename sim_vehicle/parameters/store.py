"""The values of a vehicle's parameters, which outlive its reboots."""

from collections.abc import Mapping

from sim_vehicle.parameters.definitions import Definition, definitions


class Parameters(dict[str, float]):
    """``parameters["MPC_XY_P"]`` is the value that counts now, in PX4's unit; whole numbers are of type int.

    A dict, so that reading costs nothing; it is changed by `set` and `boot` alone. PX4 stores whatever number it is
    sent. So does this store (`stored`), but what counts is kept within the range that PX4 states: no code behind it
    was written for more.
    """

    def __init__(self, own_defaults: Mapping[str, float] | None = None) -> None:
        """``own_defaults``: what this airframe has in place of the table's defaults."""
        self._definitions = definitions()
        own = own_defaults or {}
        self.defaults = {name: own.get(name, row.default) for name, row in self._definitions.items()}
        self._stored = dict(self.defaults)
        self.changes = 0
        """Grows with every change of a value that counts."""
        self.sets = 0
        """Grows with every change of a stored value."""
        self._last_set: dict[str, int] = {}
        super().__init__(self.defaults)

    @property
    def names(self) -> tuple[str, ...]:
        """All names in the order of their indices."""
        return tuple(self._definitions)

    def definition(self, name: str) -> Definition | None:
        """What the parameter is; None where there is none of that name."""
        return self._definitions.get(name)

    def stored(self, name: str) -> float:
        """The value as it was set. Raises KeyError for a name without a row in the table."""
        return self._stored[name]

    def set(self, name: str, value: float) -> None:
        """Store ``value``; it counts at once, or after the next reboot where PX4 needs one."""
        row = self._definitions[name]
        stored = int(value) if row.is_whole else value
        if stored != self._stored[name]:
            self.sets += 1
            self._last_set[name] = self.sets
        self._stored[name] = stored
        if not row.needs_reboot:
            self._make_count(row)

    def set_after(self, sets: int) -> list[str]:
        """The names whose stored value has changed since `sets` was that number."""
        return sorted(name for name, at in self._last_set.items() if at > sets)

    def boot(self) -> None:
        """Let the values count that were waiting for a reboot."""
        for row in self._definitions.values():
            self._make_count(row)

    def _make_count(self, row: Definition) -> None:
        # A default of the airframe may lie outside PX4's range, which is meant for PX4's own control.
        stored = self._stored[row.name]
        value = stored if stored == self.defaults[row.name] else row.limited(stored)
        if value != self[row.name]:
            self[row.name] = value
            self.changes += 1
