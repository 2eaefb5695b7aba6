"""Faults that disturb the same things, some from the start and some that come and go while the vehicle flies."""

from typing import Generic, TypeVar

FaultType = TypeVar("FaultType")


class Group(Generic[FaultType]):
    """The faults that act, or will, in the order in which they came."""

    def __init__(self) -> None:
        self._faults: list[FaultType] = []
        self.had_any = False

    def add(self, fault: FaultType) -> None:
        """Add a fault. It acts in its own window of the boot clock, s."""
        self._faults.append(fault)
        self.had_any = True

    def remove(self, fault: FaultType) -> None:
        """End or cancel a fault: the same object that was added."""
        self._faults = [kept for kept in self._faults if kept is not fault]
