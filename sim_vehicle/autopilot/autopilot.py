"""The autopilot as a whole: who is in command, what is flown, when it arms and disarms."""

from enum import IntEnum

from sim_vehicle.autopilot import commands, offboard
from sim_vehicle.autopilot.arming import Arming, Reason
from sim_vehicle.autopilot.battery import Battery
from sim_vehicle.autopilot.estimate import Estimate, Vector3, yaw_of
from sim_vehicle.autopilot.land_detector import LandDetector
from sim_vehicle.autopilot.messages import Command, CommandAck, PositionTarget, Result, Severity, StatusText
from sim_vehicle.autopilot.modes import ARMABLE, Conditions, Event, Mode, ModeState
from sim_vehicle.autopilot.takeoff import Takeoff, wants_takeoff
from sim_vehicle.autopilot.trajectory import ModeTrajectory
from sim_vehicle.geography import Origin
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.setpoint import TrajectorySetpoint

# Modes in which PX4's navigator has a setpoint.
AUTO_MODES = frozenset({Mode.MISSION, Mode.LOITER, Mode.RETURN, Mode.TAKEOFF, Mode.LAND})

# PX4's estimator publishes position and velocity, and its position control runs, every 8 ms.
POSITION_PERIOD_US = 8_000


class SystemStatus(IntEnum):
    """MAV_STATE as PX4 uses it."""

    NOT_READY = 0
    STANDBY = 3
    ACTIVE = 4
    FAILSAFE = 5


class LandedState(IntEnum):
    """MAV_LANDED_STATE."""

    ON_GROUND = 1
    IN_AIR = 2
    TAKING_OFF = 3
    LANDING = 4


class Autopilot:
    """Commands and setpoints in; modes, a demand for the position control, texts and acks out."""

    def __init__(self, hover_thrust_fraction: float, first: Estimate, parameters: Parameters) -> None:
        self.parameters = parameters
        self.battery = Battery(parameters)
        self.origin = Origin()
        self.home_set_us = first.time_boot_us
        self.modes = ModeState()
        self.arming = Arming(parameters)
        self.signal = offboard.OffboardSignal()
        self.detector = LandDetector(hover_thrust_fraction, parameters)
        self.applied: TrajectorySetpoint | None = None
        self.texts: list[StatusText] = []
        self._takeoff = Takeoff(parameters)
        self._trajectory = ModeTrajectory(parameters)
        self._estimate = first
        self._now_us = first.time_boot_us
        self._demanded_us = first.time_boot_us
        self._demand: TrajectorySetpoint | None = None
        self._offboard_demand = offboard.STOP
        self._commands: list[Command] = []
        self._set_home()

    # --- what comes in -----------------------------------------------------------------------------------

    def command(self, command: Command) -> None:
        """Queue a command: the commander gets to it in its next cycle."""
        self._commands.append(command)

    def setpoint(self, target: PositionTarget) -> None:
        """Take an offboard setpoint, valid or not, whatever the mode; it only flies in OFFBOARD."""
        refusal = offboard.refusal(target)
        if refusal is not None:
            self.texts.append(refusal)
            return
        self.signal.heard(self._now_us)
        if self.modes.mode is Mode.OFFBOARD:
            self._offboard_demand = offboard.trajectory_setpoint(target, self._estimate.attitude_wxyz)

    def observe(self, estimate: Estimate) -> None:
        """Take what the sensors and the estimator say at the end of an interval."""
        self._estimate = estimate
        self._now_us = estimate.time_boot_us
        self.battery.update(self._now_us, self.arming.armed, estimate.thrust_fraction)

    # --- the commander's cycle ---------------------------------------------------------------------------

    def run_commander(self) -> list[CommandAck]:
        """Commands, offboard's signal, arming: everything that can change mode or arming."""
        self.signal.update(self._now_us)
        if self.modes.mode is Mode.OFFBOARD and self.arming.armed and not self.signal.arrives:
            self._change_mode(Event.SETPOINTS_LOST)
            self._say(Severity.CRITICAL, "Failsafe activated")
        elif self.modes.mode is Mode.OFFBOARD_LOST and self.signal.is_back:
            self._change_mode(Event.SETPOINTS_BACK)
        elif self.modes.mode is Mode.TAKEOFF and self._takeoff_is_over():
            self._change_mode(Event.TAKEOFF_REACHED)
        if self.arming.armed:
            reason = self.arming.disarm_by_itself(self._now_us, self.detector.landed)
            if reason is not None:
                self._disarmed(reason)
        if not self._commands:
            return []
        queue, self._commands = self._commands, []
        return [ack for command in queue if (ack := self._execute(command)) is not None]

    def _execute(self, command: Command) -> CommandAck | None:
        result = commands.execute(command, self)
        return None if result is None else commands.answer(command, result)

    def _takeoff_is_over(self) -> bool:
        return (
            self.arming.armed
            and not self.detector.landed
            and self._trajectory.takeoff_is_reached(self._estimate.position_ned_m)
        )

    def request_mode(self, mode: Mode, says_so: str | None = None) -> Result:
        """Change the mode as a command asks."""
        if not self._change_mode(Event.REQUEST, mode):
            return Result.TEMPORARILY_REJECTED
        if says_so is not None:
            self._say(Severity.INFO, says_so)
        return Result.ACCEPTED

    def refuse_mode(self, why: str) -> Result:
        """Turn down a mode that does not exist."""
        self._say(Severity.CRITICAL, why)
        return Result.TEMPORARILY_REJECTED

    def arm(self, forced: bool) -> Result:
        """Arm as a command asks."""
        was_armed = self.arming.armed
        result = self.arming.arm(self._now_us, self.checks_pass, forced)
        if result is not Result.ACCEPTED:
            self._say(Severity.CRITICAL, "Arming denied: Resolve system health failures first")
        elif not was_armed:
            self._say(Severity.INFO, f"Armed by {Reason.COMMAND}")
            self._set_home()
            self._enter(self.modes.mode)
        return result

    def disarm(self, forced: bool) -> Result:
        """Disarm as a command asks."""
        was_armed = self.arming.armed
        result = self.arming.disarm(self.detector.landed or self.detector.maybe_landed, forced)
        if result is not Result.ACCEPTED:
            self._say(Severity.CRITICAL, "Disarming denied: not landed")
        elif was_armed:
            self._disarmed(Reason.COMMAND)
        return result

    def _disarmed(self, reason: Reason) -> None:
        self._say(Severity.INFO, f"Disarmed by {reason}")
        self._change_mode(Event.DISARMED)

    def _change_mode(self, event: Event, requested: Mode | None = None) -> bool:
        previous = self.modes.mode
        conditions = Conditions(self.arming.armed, self.signal.arrives)
        if not self.modes.apply(event, conditions, requested):
            return False
        if self.modes.mode is not previous or event is Event.REQUEST:
            self._enter(previous)
        return True

    def _enter(self, previous: Mode) -> None:
        estimate = self._estimate
        self._trajectory.enter(
            self.modes.mode,
            previous,
            estimate.position_ned_m,
            estimate.velocity_ned_m_s,
            yaw_of(estimate.attitude_wxyz),
        )
        # Until the first setpoint arrives in OFFBOARD, the last demand goes on, or the vehicle stops.
        if self.modes.mode is Mode.OFFBOARD and previous is not Mode.OFFBOARD:
            self._offboard_demand = self._demand or offboard.STOP

    def _set_home(self) -> None:
        self.set_home_at(self._estimate.position_ned_m, yaw_of(self._estimate.attitude_wxyz))

    def set_home_here(self) -> Result:
        """DO_SET_HOME with the present position."""
        self._set_home()
        return Result.ACCEPTED

    def set_home_at(self, position_ned_m: Vector3, yaw_rad: float) -> None:
        """Where RETURN leads to from now on."""
        self._trajectory.set_home(position_ned_m, yaw_rad)
        self.home_set_us = self._now_us

    def _say(self, severity: Severity, text: str) -> None:
        self.texts.append(StatusText(severity, text))

    # --- what is flown -----------------------------------------------------------------------------------

    def run_control(self) -> TrajectorySetpoint | None:
        """The demand for the coming interval, renewed every 8 ms; None lets the motors idle."""
        elapsed_us = self._now_us - self._demanded_us
        if elapsed_us < POSITION_PERIOD_US:
            return self.applied
        self._demanded_us = self._now_us
        self._detect_landing()
        down_m = self._estimate.position_ned_m[2]
        self._demand = self._demand_of_mode(1e-6 * elapsed_us)
        self._takeoff.update(self._now_us, self.arming.armed, self.detector.landed, self._wants_takeoff(down_m))
        self.applied = self._takeoff.allowed(self._demand, self._now_us, down_m, self.detector.ground_contact)
        return self.applied

    def _demand_of_mode(self, step_s: float) -> TrajectorySetpoint | None:
        mode = self.modes.mode
        if mode is Mode.OFFBOARD:
            return self._offboard_demand
        if self.detector.landed and mode is not Mode.TAKEOFF:
            return None
        return self._trajectory.demand(mode, self._estimate.position_ned_m, step_s)

    def _wants_takeoff(self, down_m: float) -> bool:
        mode = self.modes.mode
        return mode is Mode.TAKEOFF or (mode is Mode.OFFBOARD and wants_takeoff(self._demand, down_m))

    def _detect_landing(self) -> None:
        estimate, was_landed = self._estimate, self.detector.landed
        self.detector.update(
            self._now_us,
            self.arming.armed,
            estimate.velocity_ned_m_s,
            estimate.angular_velocity_frd_rad_s,
            estimate.specific_force_frd_m_s2,
            estimate.thrust_fraction,
            self._demand.velocity_ned_m_s[2] if self._demand is not None else None,
        )
        if not self.arming.armed or was_landed == self.detector.landed:
            return
        if was_landed:
            self._say(Severity.INFO, "Takeoff detected")
            self._set_home()
        else:
            self._say(Severity.INFO, "Landing detected")

    # --- what is shown -----------------------------------------------------------------------------------

    @property
    def home_ned_m(self) -> Vector3:
        """HOME_POSITION, local NED."""
        return self._trajectory.home_ned_m

    @property
    def home_yaw_rad(self) -> float:
        """Heading at home."""
        return self._trajectory.home_yaw_rad

    @property
    def auto_target_ned_m(self) -> Vector3 | None:
        """Where a mode that flies by itself is going, local NED; None in all other modes and on the ground."""
        is_auto = self.modes.shown in AUTO_MODES and not self.detector.landed
        return self._trajectory.target_ned_m if is_auto else None

    @property
    def checks_pass(self) -> bool:
        """Whether the vehicle could be armed in its present mode."""
        mode = self.modes.mode
        return mode in ARMABLE or (mode is Mode.OFFBOARD and self.signal.arrives)

    @property
    def system_status(self) -> SystemStatus:
        """HEARTBEAT.system_status."""
        if self.arming.armed:
            return SystemStatus.FAILSAFE if self.modes.in_failsafe else SystemStatus.ACTIVE
        return SystemStatus.STANDBY if self.checks_pass else SystemStatus.NOT_READY

    @property
    def landed_state(self) -> LandedState:
        """EXTENDED_SYS_STATE.landed_state."""
        if self.detector.landed:
            return LandedState.ON_GROUND
        mode = self.modes.mode
        if mode is Mode.TAKEOFF:
            return LandedState.TAKING_OFF
        if mode is Mode.LAND or (mode is Mode.RETURN and self._trajectory.is_descending_to_land):
            return LandedState.LANDING
        return LandedState.IN_AIR
