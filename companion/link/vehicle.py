"""The vehicle's identity and its last reported state, with the times of the reports."""

from dataclasses import dataclass, field

from companion import messages
from companion.autopilot.interface import Autopilot, Pilot
from companion.autopilot.known import ASSUMED, AUTOPILOTS, NAMES, defaults
from companion.motion.history import MotionHistory
from companion.motion.rotation import yaw_rad

# MAV_COMP_ID_AUTOPILOT1: gimbals, cameras and ground stations on the same link have other numbers.
AUTOPILOT_COMPONENT_ID = 1

# MAV_TYPE: hover, sideways force and land detection are the same for all of these.
MULTICOPTERS = {2: "quadrotor", 13: "hexarotor", 14: "octorotor", 15: "tricopter", 29: "dodecarotor", 35: "decarotor"}


@dataclass(frozen=True, slots=True)
class Identity:
    system_id: int
    component_id: int
    vehicle_type: str
    autopilot: Autopilot


def is_autopilot(heartbeat: messages.Heartbeat) -> bool:
    return heartbeat.component_id == AUTOPILOT_COMPONENT_ID


def identify(heartbeat: messages.Heartbeat) -> Identity | str:
    """The vehicle's identity, or one sentence why it cannot be flown."""
    autopilot = AUTOPILOTS.get(heartbeat.autopilot)
    if autopilot is None:
        return f"the vehicle's autopilot is not {NAMES} (MAV_AUTOPILOT {heartbeat.autopilot})"
    vehicle_type = MULTICOPTERS.get(heartbeat.vehicle_type)
    if vehicle_type is None:
        return f"the vehicle is not a multicopter (MAV_TYPE {heartbeat.vehicle_type})"
    return Identity(heartbeat.system_id, heartbeat.component_id, vehicle_type, autopilot)


# MAV_STATE_CRITICAL and above: PX4 says so while a failsafe acts.
FAILSAFE_STATUS = 5
# After this silence the last reported mode is old: without setpoints the vehicle has left the mode that flies them. A
# later setpoint would take the vehicle away from whoever has it then.
OLD_NEWS_US = defaults.LOSS_US
# As long as PX4's own land detector takes (MulticopterLandDetector.cpp, land_detection_time, 1 s in three stages). One
# whose estimator failed said for 0.14 s, 11 m up, that it had landed.
STANDS_US = 1_000_000


@dataclass(slots=True)
class Vehicle:
    """The vehicle's reported state. Receive times are on the companion's clock, motion on the vehicle's.

    A mode that is not the companion's, and a disarm in the air, count from the second report on: one forged or broken
    packet ends no flight. After the first report they are unconfirmed, and no command is sent.
    """

    identity: Identity | None = None
    autopilot: Autopilot = ASSUMED  # the identity's, once there is one
    version: tuple[int, int, int] | None = None
    attitude_parameters: dict[str, int | float] = field(default_factory=dict)  # see interface.Autopilot
    armed: bool | None = None
    mode: messages.CurrentMode | None = None
    is_failsafe_mode: bool = False  # as far as its report says
    chosen_mode: int | None = None  # by whoever flies
    tells_chosen: bool = False  # in a message of its own
    pilot: Pilot | None = None  # who moves it, where that mode says so
    failsafe: bool = False
    landed: messages.LandedState = messages.LandedState.UNDEFINED
    landed_us: int = 0  # when it began to say so
    attitude: messages.Attitude | None = None
    thrust_fraction: float | None = None  # as last commanded
    battery_percent: int | None = None  # the higher of the last two reports
    battery_told: int | None = None  # the newest
    said: str = ""  # its newest warning, since it was asked to arm
    history: MotionHistory = field(default_factory=MotionHistory)
    last_received_us: int = 0
    last_position_us: int | None = None
    mode_received_us: int = 0
    unsure_since_us: int = -1  # only a report of the mode that is newer than this says who has the vehicle
    unconfirmed_mode: messages.CurrentMode | None = None  # reported once, and not the companion's
    is_disarm_unconfirmed: bool = False  # reported once, in the air
    is_disarm_unexplained: bool = False  # and not yet contradicted by a vehicle that says that it flies

    @property
    def is_mode_known(self) -> bool:
        """Whether the vehicle may be commanded: its mode is new and not contradicted."""
        is_new = self.mode_received_us > self.unsure_since_us
        return is_new and self.unconfirmed_mode is None and not self.is_disarm_unexplained

    def update(self, sample: object, now_us: int, own_modes: tuple[int | None, ...] = ()) -> None:
        """Take one sample of the identified vehicle. Without `own_modes` every mode is accepted at once."""
        self.last_received_us = now_us
        match sample:
            case messages.LocalPosition():
                if self.history.add(sample):
                    self.last_position_us = now_us
            case messages.Attitude():
                self.attitude = sample
            case messages.AttitudeTarget():
                self.thrust_fraction = sample.thrust_fraction
            case messages.Heartbeat():
                self._update_armed(sample.armed)
                self.failsafe = sample.system_status >= FAILSAFE_STATUS
                # A failsafe's own mode is nobody's choice where the vehicle leaves it by itself.
                is_choice = not self.failsafe or not self.autopilot.wants_setpoints_first
                if is_choice and not self.tells_chosen:
                    self.chosen_mode = sample.custom_mode
                report = messages.CurrentMode(sample.custom_mode, None)
                self._update_mode(report, self.failsafe, own_modes, now_us)
            case messages.CurrentMode():
                intended = sample.intended_custom_mode
                if intended is not None:
                    self.chosen_mode, self.tells_chosen = intended, True
                # The intended mode is newer than the last HEARTBEAT's status, where it is given.
                self._update_mode(sample, self.failsafe and intended is None, own_modes, now_us)
            case messages.ExtendedState():
                self.landed_us = self.landed_us if sample.landed_state is self.landed else now_us
                self.landed = sample.landed_state
                if self.is_disarm_unconfirmed and self.landed is messages.LandedState.ON_GROUND:
                    self._accept_armed(False)
                elif self.is_disarm_unexplained and self.landed is messages.LandedState.IN_AIR:
                    self.is_disarm_unexplained = False
            case messages.Battery():
                # One forged or broken report ends no flight.
                self.battery_percent = max(sample.remaining_percent, self.battery_told or 0)
                self.battery_told = sample.remaining_percent
            case messages.AutopilotVersion():
                self.version = sample.flight_version

    def _update_mode(
        self, report: messages.CurrentMode, failsafe: bool, own_modes: tuple[int | None, ...], now_us: int
    ) -> None:
        self.mode_received_us = now_us
        is_known = self.mode is None or report.custom_mode in (self.mode.custom_mode, *own_modes)
        if is_known or not own_modes or self.unconfirmed_mode is not None:
            self.count_mode(report, failsafe)
            self.unconfirmed_mode = None
        else:
            self.unconfirmed_mode = report

    def count_mode(self, report: messages.CurrentMode, failsafe: bool = False) -> None:
        """It is the vehicle's from now on."""
        self.mode, self.is_failsafe_mode = report, failsafe
        self.pilot = self.autopilot.mode(report.custom_mode).pilot

    def _update_armed(self, armed: bool) -> None:
        is_on_ground = self.landed is messages.LandedState.ON_GROUND
        if armed or self.armed is not True or self.is_disarm_unconfirmed or is_on_ground:
            self._accept_armed(armed)
        else:
            self.is_disarm_unconfirmed = self.is_disarm_unexplained = True

    def _accept_armed(self, armed: bool) -> None:
        self.armed, self.is_disarm_unconfirmed, self.is_disarm_unexplained = armed, False, False

    @property
    def is_airborne(self) -> bool:
        return self.armed is True and self.landed is not messages.LandedState.ON_GROUND

    @property
    def stands(self) -> bool:
        """Whether it is on the ground, and has said so for a while: a land detector may be wrong in the air."""
        said_us = self.last_received_us - self.landed_us
        return self.landed is messages.LandedState.ON_GROUND and said_us >= STANDS_US

    @property
    def heading_rad(self) -> float | None:
        """Clockwise from north; None before it has told its attitude."""
        return None if self.attitude is None else yaw_rad(self.attitude.attitude_wxyz)

    @property
    def custom_mode(self) -> int | None:
        return self.mode.custom_mode if self.mode is not None else None

    @property
    def mode_name(self) -> str:
        return "" if self.mode is None else self.autopilot.mode(self.mode.custom_mode).name

    @property
    def flies_setpoints(self) -> bool:
        return self.custom_mode == self.autopilot.setpoints

    @property
    def is_mode_chosen(self) -> bool:
        """Whether somebody has chosen another mode than that for setpoints: no failsafe for want of them has."""
        return self.chosen_mode is not None and self.chosen_mode != self.autopilot.setpoints

    def version_complaint(self) -> str | None:
        """Why this version cannot be flown; None where it can, or has not said which it is."""
        least = self.autopilot.least_version
        if self.version is None or self.version >= least:
            return None
        oldest = f"{self.autopilot.name} {least[0]}.{least[1]}"
        return f"{self.autopilot_text()} is too old: {oldest} is the oldest that flies"

    def autopilot_text(self) -> str:
        """For people and the report, for example "PX4 1.15.0"; empty before there is a vehicle."""
        if self.identity is None:
            return ""
        name = self.autopilot.name
        return name if self.version is None else f"{name} " + ".".join(str(part) for part in self.version)
