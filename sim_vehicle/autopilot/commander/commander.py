"""Who is in command: the mode that is meant and the one that flies, arming, and what the failsafes make of it.

Sources: PX4's commander/Commander.cpp and commander/HealthAndArmingChecks (rcAndDataLinkCheck, estimatorCheck,
geofenceCheck, modeCheck).
"""

from enum import IntEnum

from sim_vehicle.autopilot.commander.arming import Arming, Reason
from sim_vehicle.autopilot.commander.battery import Battery
from sim_vehicle.autopilot.commander.failsafe import Failsafe
from sim_vehicle.autopilot.commander.failsafe_table import FailsafeSituation
from sim_vehicle.autopilot.commander.watching import GroundStation, ManualInput, Positioning
from sim_vehicle.autopilot.land_detector import LandDetector
from sim_vehicle.autopilot.messages import Result, Severity, StatusText, Texts
from sim_vehicle.autopilot.mode_numbers import NUMBERS
from sim_vehicle.autopilot.modes import (
    NEEDS,
    NOT_ARMABLE,
    Conditions,
    Mode,
    ModeEvent,
    ModeState,
    Need,
    cannot_run,
    missing,
)
from sim_vehicle.autopilot.navigator.navigator import Navigator
from sim_vehicle.autopilot.offboard import OffboardSignal
from sim_vehicle.parameters.store import Parameters

# How often the failsafes look when nothing calls for it: PX4's commander runs every 10 ms, its checks every 100.
PERIOD_US = 20_000
# COM_RC_OVERRIDE: in which modes moved sticks take over.
_OVERRIDES_AUTO, _OVERRIDES_OFFBOARD = 1, 2
# COM_ARM_WO_GPS: 0 refuses, 1 warns, 2 does not care.
_NOT_WITHOUT_GPS = 0


class SystemStatus(IntEnum):
    """MAV_STATE as PX4 uses it."""

    NOT_READY = 0
    STANDBY = 3
    ACTIVE = 4
    FAILSAFE = 5
    TERMINATED = 8


class Commander:
    """Requests and the time in; the mode to fly, texts out."""

    def __init__(self, parameters: Parameters, navigator: Navigator, detector: LandDetector, texts: Texts) -> None:
        self.modes = ModeState()
        self.arming = Arming(parameters)
        self.failsafe = Failsafe()
        self.signal = OffboardSignal(parameters)
        self.sticks = ManualInput(parameters)
        self.ground_station = GroundStation(parameters)
        self.battery = Battery(parameters)
        self.positioning = Positioning(parameters)
        self.texts = texts
        self.parameters = parameters
        self.navigator = navigator
        self._detector = detector
        self._now_us = 0
        self._judged_us = -PERIOD_US
        self._sticks_lost_at_arming = True
        self._ever_requested = False

    # --- requests --------------------------------------------------------------------------------------------

    def request_mode(self, mode: Mode, says_so: str | None = None, tells: bool = True) -> Result:
        """Change the mode as a command asks; ``says_so``: the text for a change; ``tells``: a refusal has one."""
        self._ever_requested = True
        if not self.modes.apply(ModeEvent.REQUEST, self._conditions, mode):
            if tells:
                self.texts.say(Severity.CRITICAL, f"Switching to {NUMBERS[mode].title} is currently not available")
            return Result.TEMPORARILY_REJECTED
        self._judge(mode_requested=True)
        if says_so is not None:
            self.texts.say(Severity.INFO, says_so)
        return Result.ACCEPTED

    def arm(self, reason: Reason = Reason.COMMAND) -> Result:
        """Arm as a command asks."""
        was_armed = self.arming.armed
        result = self.arming.arm(self._now_us, self.checks_pass)
        if result is not Result.ACCEPTED:
            self.texts += self._problems
            self.texts.say(Severity.CRITICAL, "Arming denied: Resolve system health failures first")
        elif not was_armed:
            self.texts.say(Severity.INFO, f"Armed by {reason}")
            self._sticks_lost_at_arming = self.sticks.sticks is None
            self.navigator.view.armed = True
            self.navigator.set_home_here()
            self.navigator.enter(self.modes.flown)
            self._judge()
        return result

    def disarm(self, forced: bool) -> Result:
        """Disarm as a command asks."""
        was_armed = self.arming.armed
        result = self.arming.disarm(self._detector.landed or self._detector.maybe_landed, forced)
        if result is not Result.ACCEPTED:
            self.texts.say(Severity.CRITICAL, "Disarming denied: not landed")
        elif was_armed:
            self._disarmed(Reason.COMMAND)
        return result

    def _disarmed(self, reason: Reason) -> None:
        self.texts.say(Severity.INFO, f"Disarmed by {reason}")
        self.parameters.set("COM_FLIGHT_UUID", self.parameters["COM_FLIGHT_UUID"] + 1)
        self.navigator.view.armed = False
        self.navigator.disarmed()
        self.modes.apply(ModeEvent.DISARMED, self._conditions)
        self._judge()

    # --- the cycle -------------------------------------------------------------------------------------------

    def run(self, now_us: int) -> None:
        """Everything that changes mode or arming by itself; call it at every step."""
        self._now_us = now_us
        setpoints_changed = self.signal.update(now_us)
        if self.sticks.sticks is not None:
            self.sticks.update(now_us)
            self._obey_sticks()
        if self.modes.flown in (Mode.MISSION, Mode.TAKEOFF) and not self._detector.landed:
            over = self._what_is_over()
            if over is not None and self.modes.apply(over, self._conditions):
                self._judge()
        if self.arming.armed:
            self._disarm_by_itself()
        if now_us - self._judged_us >= PERIOD_US or setpoints_changed:
            self.texts += self.ground_station.update(now_us)
            self.positioning.update(now_us)
            self._judge()

    def _what_is_over(self) -> ModeEvent | None:
        """Commander::checkForMissionUpdate."""
        if self.modes.flown is Mode.MISSION:
            return ModeEvent.MISSION_FINISHED if self.navigator.missions.progress.finished else None
        return ModeEvent.TAKEOFF_REACHED if self.navigator.takeoff_is_over else None

    def _obey_sticks(self) -> None:
        if not self.arming.armed:
            if not self._ever_requested and self.sticks.sticks is not None:
                # As long as nobody has chosen a mode, sticks that arrive choose theirs.
                self._ever_requested = True
                self.modes.mean(Mode.POSCTL)
            return
        if not self.sticks.moving or self.failsafe.acts or not self._sticks_override:
            return
        if self.modes.apply(ModeEvent.STICKS, self._conditions):
            self.texts.say(Severity.INFO, "Pilot took over using sticks")
            self._judge()

    @property
    def _sticks_override(self) -> bool:
        mode, mask = self.modes.flown, int(self.parameters["COM_RC_OVERRIDE"])
        if mode is Mode.OFFBOARD:
            return bool(mask & _OVERRIDES_OFFBOARD)
        return Need.STICKS not in NEEDS[mode] and bool(mask & _OVERRIDES_AUTO)

    def _disarm_by_itself(self) -> None:
        landed, is_in_mission = self._detector.landed, self.modes.flown is Mode.MISSION
        if landed and self.arming.taken_off and is_in_mission and not self.navigator.missions.progress.finished:
            return
        reason = self.arming.disarm_by_itself(self._now_us, landed)
        if reason is not None:
            self._disarmed(reason)

    def _judge(self, mode_requested: bool = False) -> None:
        """Let the failsafes say what flies."""
        self._judged_us = self._now_us
        decision = self.failsafe.update(self._now_us, self._situation(mode_requested), self.parameters)
        for text in decision.says:
            self.texts.say(Severity.CRITICAL, text)
        if decision.intended is not self.modes.intended:
            self.modes.mean(decision.intended)
        if decision.flown is not self.modes.flown:
            self.modes.flown = decision.flown
            self.navigator.enter(decision.flown)

    def _situation(self, mode_requested: bool) -> FailsafeSituation:
        back = self._flies_setpoints and (self.signal.is_back or not self.failsafe.acts)
        return FailsafeSituation(
            armed=self.arming.armed,
            intended=self.modes.intended,
            mode_requested=mode_requested,
            sticks_moved=self.failsafe.acts and self.sticks.moving and self._sticks_override,
            sticks_lost=self.sticks.sticks is None,
            sticks_lost_at_arming=self._were_sticks_lost_at_arming(),
            ground_station_lost=self.ground_station.lost,
            fence_breached=self.navigator.fence.breached,
            cannot_run=cannot_run(self._available, back),
        )

    def _were_sticks_lost_at_arming(self) -> bool:
        """Whoever arms without sticks is not told that they are lost, until they have come once."""
        if self.sticks.sticks is not None:
            self._sticks_lost_at_arming = False
        elif not self.arming.armed:
            self._sticks_lost_at_arming = True
        return self._sticks_lost_at_arming

    # --- what there is ---------------------------------------------------------------------------------------

    @property
    def _conditions(self) -> Conditions:
        return Conditions(self.arming.armed, self._available)

    @property
    def _flies_setpoints(self) -> bool:
        return self.signal.arrives and (self.positioning.has_local or not self.signal.needs_place)

    @property
    def _available(self) -> frozenset[Need]:
        """What modes may need, as far as it is there."""
        there = {
            Need.LOCAL_POSITION: self.positioning.has_local,
            Need.GLOBAL_POSITION: self.positioning.has_global,
            Need.STICKS: self.sticks.sticks is not None,
            Need.SETPOINTS: self._flies_setpoints,
            Need.MISSION: self.navigator.missions.progress.valid,
        }
        return frozenset([need for need, is_there in there.items() if is_there])

    @property
    def checks_pass(self) -> bool:
        """Whether the vehicle could be armed in its present mode."""
        mode = self.modes.intended
        return mode not in NOT_ARMABLE and not missing(mode, self._available) and not self._problems

    @property
    def _problems(self) -> list[StatusText]:
        """What forbids arming beside what the mode needs, and what PX4 says about it when somebody tries."""
        found, parameters = [], self.parameters
        if self.ground_station.lost and parameters["NAV_DLL_ACT"] > 0:
            found.append(StatusText(Severity.WARNING, "Preflight Fail: No connection to the GCS"))
        if self.positioning.is_without_gps and parameters["COM_ARM_WO_GPS"] == _NOT_WITHOUT_GPS:
            found.append(StatusText(Severity.CRITICAL, "Preflight Fail: GPS fix too low"))
        if self.navigator.fence.breached:
            found.append(StatusText(Severity.CRITICAL, "Geofence: approaching or outside geofence"))
        return found

    @property
    def system_status(self) -> SystemStatus:
        """HEARTBEAT.system_status."""
        if self.modes.flown is Mode.TERMINATION:
            return SystemStatus.TERMINATED
        if self.arming.armed:
            return SystemStatus.FAILSAFE if self.failsafe.acts else SystemStatus.ACTIVE
        return SystemStatus.STANDBY if self.checks_pass else SystemStatus.NOT_READY
