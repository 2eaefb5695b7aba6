"""What a flight would have known at each moment of a foreign log: armed, landed, height, on the way down."""

from companion.detection.interface import Situation
from companion.link.vehicle import OLD_NEWS_US
from companion.messages import CurrentMode, ExtendedState, Heartbeat, LandedState, LocalPosition
from companion.px4_mode import AUTO_LAND
from rebound_cli.logs.log import Demand, Heard

# AUTO.PRECLAND
_AUTO_PRECLAND = 4 << 16 | 9 << 24
# From this downward speed asked for PX4's land detector takes a descent to be meant: 1.1 x LNDMC_Z_VEL_MAX, 0.25 m/s
# (land_detector/MulticopterLandDetector.cpp).
DESCENT_M_S = 0.275
# MANUAL, ACRO, STABILIZED, RATTITUDE: the sticks ask for an attitude or for rates, and position control is off
# (commander/ModeUtil/control_mode.cpp). It is taken to act where the mode is unknown.
_BY_STICKS_ALONE = (1, 5, 7, 8)
_NO_DEMAND = Demand(0, None, None, None)


class Circumstances:
    """Takes every sample; `situation` is what they add up to. The pilot's plan is known from the modes alone."""

    def __init__(self) -> None:
        self.situation = Situation()
        self._armed: bool | None = None
        self._landed = LandedState.UNDEFINED
        self._mode = 0
        self._down_m: float | None = None
        self._ground_down_m: float | None = None
        self._demand = _NO_DEMAND
        self._demand_old_us = 0  # from then on it is no longer flown, unless it is renewed

    def hear(self, heard: Heard) -> bool:
        """Whether the sample changed the situation."""
        sample = heard.sample
        match sample:
            case LocalPosition():
                self._down_m = sample.position_ned_m[2]
                if self._ground_down_m is None and self._on_the_ground():
                    self._ground_down_m = self._down_m
            case Heartbeat():
                self._arm(sample.armed)
                self._mode = sample.custom_mode
            case CurrentMode():
                self._mode = sample.custom_mode
            case ExtendedState():
                self._landed = sample.landed_state
            case Demand():
                # PX4 keeps OFFBOARD for so long without a setpoint (COM_OF_LOSS_T); logs hold five in a second.
                self._demand, self._demand_old_us = sample, heard.at_us + OLD_NEWS_US
            case _:
                return False
        self.situation = self._now()
        return True

    def wait(self, now_us: int) -> None:
        """Time has passed: a setpoint that nobody renewed is no longer flown."""
        if self._demand is not _NO_DEMAND and now_us >= self._demand_old_us:
            self._demand = _NO_DEMAND
            self.situation = self._now()

    def _arm(self, armed: bool) -> None:
        """Heights count from the place of arming, which is where the vehicle stands when it is armed."""
        if armed and self._armed is False:
            self._ground_down_m = self._down_m
        self._armed = armed

    def _on_the_ground(self) -> bool:
        return self._landed is LandedState.ON_GROUND or self._armed is False

    def _now(self) -> Situation:
        height_m: float | None = None
        if self._down_m is not None and self._ground_down_m is not None:
            height_m = self._ground_down_m - self._down_m
        return Situation(
            off_reason="disarmed" if self._armed is False else None,
            armed=self._armed,
            landed_state=self._landed,
            height_m=height_m,
            descent_commanded=self._is_told_to_descend(),
            setpoint_position_ned_m=self._flown().position_ned_m,
        )

    def _flown(self) -> Demand:
        """The setpoint, in a mode that flies it."""
        return _NO_DEMAND if self._mode >> 16 & 0xFF in _BY_STICKS_ALONE else self._demand

    def _is_told_to_descend(self) -> bool:
        if self._mode in (AUTO_LAND, _AUTO_PRECLAND) or self._landed is LandedState.LANDING:
            return True
        down_m_s = self._flown().velocity_down_m_s
        return down_m_s is not None and down_m_s >= DESCENT_M_S
