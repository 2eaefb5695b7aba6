"""What the vehicle has last said about itself, and when."""

from dataclasses import dataclass, field

from companion.estimate.history import MotionHistory
from companion.link.identity import Identity
from companion.messages import (
    Attitude,
    AutopilotVersion,
    Battery,
    CurrentMode,
    ExtendedState,
    Heartbeat,
    ImuSample,
    LandedState,
    LocalPosition,
)

# MAV_STATE_CRITICAL and above: PX4 says so while a failsafe acts.
FAILSAFE_STATUS = 5


@dataclass(frozen=True, slots=True)
class ModeReport:
    """One message's account of the mode. `intended` is what the user last asked for, where the message says."""

    custom_mode: int
    intended_custom_mode: int | None
    failsafe: bool


@dataclass(slots=True)
class Vehicle:
    """The vehicle as heard. Ages are in the companion's clock, motion in the vehicle's."""

    identity: Identity | None = None
    version: tuple[int, int, int] | None = None
    armed: bool | None = None
    mode: ModeReport | None = None
    failsafe: bool = False
    landed: LandedState = LandedState.UNDEFINED
    attitude: Attitude | None = None
    battery_percent: int | None = None
    history: MotionHistory = field(default_factory=MotionHistory)
    last_heard_us: int = 0
    last_position_us: int | None = None

    def hear(self, sample: object, now_us: int) -> None:
        """Take in one sample of the identified vehicle."""
        self.last_heard_us = now_us
        match sample:
            case ImuSample():
                pass  # the most frequent of all: first, and nothing of it is kept here
            case LocalPosition():
                if self.history.add(sample):
                    self.last_position_us = now_us
            case Attitude():
                self.attitude = sample
            case Heartbeat():
                self.armed = sample.armed
                self.failsafe = sample.system_status >= FAILSAFE_STATUS
                self.mode = ModeReport(sample.custom_mode, None, self.failsafe)
            case CurrentMode():
                # The intended mode is newer than the last HEARTBEAT's status, where it is given.
                failsafe = self.failsafe and sample.intended_custom_mode is None
                self.mode = ModeReport(sample.custom_mode, sample.intended_custom_mode, failsafe)
            case ExtendedState():
                self.landed = sample.landed_state
            case Battery():
                self.battery_percent = sample.remaining_percent
            case AutopilotVersion():
                self.version = sample.flight_version
            case _:
                pass

    @property
    def custom_mode(self) -> int | None:
        return self.mode.custom_mode if self.mode is not None else None

    def autopilot_text(self) -> str:
        """For people and the report, for example "PX4 1.15.0"; empty before there is a vehicle."""
        if self.identity is None:
            return ""
        return "PX4" if self.version is None else "PX4 " + ".".join(str(part) for part in self.version)
