"""Faults that disturb the same things, some from the start and some that come and go while the vehicle flies."""

from typing import Generic, TypeVar

from sim_vehicle.faults.spec import Timed

FaultType = TypeVar("FaultType", bound=Timed)


class Group(Generic[FaultType]):
    """The faults that act, or will, in the order in which they came."""

    def __init__(self) -> None:
        self._faults: list[FaultType] = []
        self.had_any = False

    def add(self, fault: FaultType) -> None:
        """Add a fault. It acts in its own window of the boot clock, s."""
        self._faults.append(fault)
        self.had_any = True

    def acting(self, time_s: float) -> list[FaultType]:
        """Those in whose window this boot time lies."""
        return [fault for fault in self._faults if fault.window_s[0] <= time_s < fault.window_s[1]]

    def remove(self, fault: FaultType) -> None:
        """End or cancel a fault: the same object that was added."""
        self._faults = [kept for kept in self._faults if kept is not fault]
