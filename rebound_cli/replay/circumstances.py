"""What a flight would have known at each moment of a foreign log: armed, landed, height, on the way down."""

from companion.detection.interface import Situation
from companion.messages import CurrentMode, ExtendedState, Heartbeat, LandedState, LocalPosition
from companion.px4_mode import AUTO_LAND
from rebound_cli.logs.log import Demand, Told

# AUTO.PRECLAND
_AUTO_PRECLAND = 4 << 16 | 9 << 24
# From this downward speed asked for PX4's land detector takes a descent to be meant: 1.1 x LNDMC_Z_VEL_MAX, 0.25 m/s
# (land_detector/MulticopterLandDetector.cpp).
DESCENT_M_S = 0.275


class Circumstances:
    """Takes every sample; `situation` is what they add up to. The pilot's plan is known from the modes alone."""

    def __init__(self) -> None:
        self.situation = Situation()
        self._armed: bool | None = None
        self._landed = LandedState.UNDEFINED
        self._mode = 0
        self._down_m: float | None = None
        self._ground_down_m: float | None = None
        self._demand = Demand(0, None, None, None)

    def hear(self, sample: Told) -> bool:
        """Whether the sample changed the situation."""
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
                self._demand = sample
            case _:
                return False
        self.situation = self._now()
        return True

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
            setpoint_position_ned_m=self._demand.position_ned_m,
        )

    def _is_told_to_descend(self) -> bool:
        if self._mode in (AUTO_LAND, _AUTO_PRECLAND) or self._landed is LandedState.LANDING:
            return True
        down_m_s = self._demand.velocity_down_m_s
        return down_m_s is not None and down_m_s >= DESCENT_M_S
