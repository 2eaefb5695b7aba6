"""The autopilot as a whole: what comes in, what is flown, what is shown."""

from enum import IntEnum

from sim_vehicle.autopilot import commands, flight_commands
from sim_vehicle.autopilot.commander.commander import Commander
from sim_vehicle.autopilot.flight_tasks.manual import BY_STICKS, TAKEOFF_STICK, ManualFlight
from sim_vehicle.autopilot.flight_tasks.takeoff import Takeoff, TakeoffState, wants_takeoff
from sim_vehicle.autopilot.flight_tasks.target import Kind, NavigatorTarget, View
from sim_vehicle.autopilot.land_detector import LandDetector
from sim_vehicle.autopilot.messages import (
    AttitudeTarget,
    Command,
    CommandAck,
    FlightInput,
    PositionTarget,
    Severity,
    StickInput,
    Texts,
)
from sim_vehicle.autopilot.mission_protocol.mission_store import MissionStore
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.autopilot.navigator.navigator import Navigator
from sim_vehicle.autopilot.offboard import STATUS_PERIOD_US, OffboardControl
from sim_vehicle.control.setpoint import Setpoint, TrajectorySetpoint
from sim_vehicle.estimator.estimate import Estimate, yaw_of
from sim_vehicle.parameters.airframe_values import origin_of
from sim_vehicle.parameters.store import Parameters

# PX4's estimator publishes position and velocity, and its position control runs, every 8 ms.
POSITION_PERIOD_US = 8_000


class LandedState(IntEnum):
    """MAV_LANDED_STATE."""

    ON_GROUND = 1
    IN_AIR = 2
    TAKING_OFF = 3
    LANDING = 4


class Autopilot:
    """Commands, setpoints and sticks in; modes, a demand for the control, texts and acks out."""

    def __init__(self, hover_thrust_fraction: float, first: Estimate, parameters: Parameters) -> None:
        self.parameters = parameters
        self.origin = origin_of(parameters)
        self.missions = MissionStore()
        self.detector = LandDetector(hover_thrust_fraction, parameters)
        view = View(
            first.time_boot_us,
            first.position_ned_m,
            first.velocity_ned_m_s,
            first.attitude_wxyz,
            home_ned_m=first.position_ned_m,
            home_yaw_rad=yaw_of(first.attitude_wxyz),
        )
        self.texts = Texts()
        self.navigator = Navigator(parameters, self.origin, self.missions, view, self.texts)
        self.commander = Commander(parameters, self.navigator, self.detector, self.texts)
        self.modes, self.arming = self.commander.modes, self.commander.arming
        self.signal, self.battery = self.commander.signal, self.commander.battery
        self._offboard = OffboardControl(self.signal)
        self.applied: Setpoint | None = None
        self._manual = ManualFlight(parameters, hover_thrust_fraction)
        self._takeoff = Takeoff(parameters)
        self._estimate = first
        self._now_us = first.time_boot_us
        self._demanded_us = first.time_boot_us
        self._demand: Setpoint | None = None
        self._flown = self.modes.flown
        self._sinks = False
        self._commands: list[Command] = []
        self._status_us = first.time_boot_us

    # --- what comes in -----------------------------------------------------------------------------------

    def command(self, command: Command) -> None:
        """Queue a command: the commander gets to it in its next cycle."""
        self._commands.append(command)

    def receive(self, message: FlightInput) -> None:
        """Take a setpoint, sticks or a target to follow, whatever the mode; a setpoint only flies in OFFBOARD."""
        is_flown = self.modes.flown is Mode.OFFBOARD
        if isinstance(message, PositionTarget):
            refusal = self._offboard.take_position(message, self._now_us, is_flown, self._estimate.attitude_wxyz)
            if refusal is not None:
                self.texts.append(refusal)
        elif isinstance(message, AttitudeTarget):
            self._offboard.take_attitude(message, self._now_us, is_flown)
        elif isinstance(message, StickInput):
            self.commander.sticks.heard(message, self._now_us)
        else:
            self.navigator.follow.heard(message, self.navigator.view.now_us)

    def ground_station_heard(self) -> None:
        """A ground station's heartbeat came over some link."""
        self.commander.ground_station.heard(self._now_us)

    def observe(self, estimate: Estimate) -> None:
        """Take what the sensors and the estimator say at the end of an interval."""
        self._estimate = estimate
        self._now_us = estimate.time_boot_us
        self.battery.update(self._now_us, self.arming.armed)

    def begin_in_flight(self, goal: NavigatorTarget) -> None:
        """As after a while on the way in HOLD: armed, off the ground, with a demand for the motors."""
        self.detector.begin_in_flight()
        self._takeoff.state = TakeoffState.FLIGHT
        home = self.navigator.view.home_ned_m, self.navigator.view.home_yaw_rad
        self._look()
        self.commander.arm()
        self.navigator.set_home(*home)
        self.texts.clear()
        self.navigator.hold_at(goal)
        self._demanded_us = self._now_us - POSITION_PERIOD_US

    # --- commands ----------------------------------------------------------------------------------------

    def run_commander(self) -> list[CommandAck]:
        """Commands, failsafes, arming: everything that can change mode or arming."""
        self._look()
        self.commander.run(self._now_us)
        if self.navigator.mission.commands:
            self._run_mission_commands()
        acks: list[CommandAck] = []
        if self._commands or self._now_us - self._status_us >= STATUS_PERIOD_US:
            self._status_us = self._now_us
            self._offboard.status_published()
        if self._commands:
            self.navigator.notice_changes()  # a list that has just come is judged before it is to be flown
            queue, self._commands = self._commands, []
            acks = [ack for command in queue if (ack := commands.execute(command, self.commander)) is not None]
        if self.modes.flown is not self._flown:
            self._notice_mode()
        return acks

    def _notice_mode(self) -> None:
        previous, self._flown = self._flown, self.modes.flown
        if self._flown is Mode.OFFBOARD:
            self._offboard.begin(self._demand)
        if self._flown in BY_STICKS and previous not in BY_STICKS:
            self._manual.start(self.navigator.view)

    # --- what is flown -----------------------------------------------------------------------------------

    @property
    def motors_run(self) -> bool:
        """Armed, and the flight not terminated."""
        return self.arming.armed and self.modes.flown is not Mode.TERMINATION

    def run_control(self) -> Setpoint | None:
        """The demand for the coming interval, renewed every 8 ms; None lets the motors idle."""
        elapsed_us = self._now_us - self._demanded_us
        if elapsed_us < POSITION_PERIOD_US:
            return self.applied
        self._demanded_us = self._now_us
        self._detect_landing()
        self.navigator.update()
        self._demand = demand = self._demand_of_mode(1e-6 * elapsed_us)
        down_m, armed = self._estimate.position_ned_m[2], self.arming.armed
        if demand is not None and not isinstance(demand, TrajectorySetpoint):
            self._takeoff.skip(self._now_us, armed, self.detector.landed)
            self.applied = demand if armed else None
            return self.applied
        self._takeoff.update(self._now_us, armed, self.detector.landed, self._wants_takeoff(down_m))
        self.applied = self._takeoff.allowed(demand, self._now_us, down_m, self.detector.ground_contact)
        return self.applied

    def _look(self) -> None:
        """Let the navigator see where the vehicle is."""
        view, estimate = self.navigator.view, self._estimate
        view.now_us, view.position_ned_m = estimate.time_boot_us, estimate.position_ned_m
        view.velocity_ned_m_s, view.attitude_wxyz = estimate.velocity_ned_m_s, estimate.attitude_wxyz
        view.landed, view.armed = self.detector.landed, self.arming.armed

    def _run_mission_commands(self) -> None:
        """In the interval after the items that gave them: what was reached until then has been told by now."""
        given, self.navigator.mission.commands = self.navigator.mission.commands, []
        for item in given:
            commands.execute(flight_commands.from_mission(item), self.commander)

    def _demand_of_mode(self, step_s: float) -> Setpoint | None:
        mode = self.modes.flown
        self._manual.spin_up(self.arming.armed, step_s)
        if mode is Mode.OFFBOARD:
            return self._offboard.demand
        if mode is Mode.TERMINATION:
            return None
        if mode not in BY_STICKS:
            self._sinks = False
            return self.navigator.demand(step_s)
        sticks = self.commander.sticks.sticks
        if sticks is None:
            return self._sink(step_s)
        if self._sinks:
            self._manual.start(self.navigator.view)
            self._sinks = False
        return self._manual.demand(mode, sticks, self.navigator.view, step_s)

    def _sink(self, step_s: float) -> TrajectorySetpoint | None:
        """A mode of sticks without sticks: PX4 comes down, whatever the mode is called."""
        if not self._sinks:
            self.navigator.sink_here()
            self._sinks = True
        return None if self.detector.landed else self.navigator.sink(step_s)

    def _wants_takeoff(self, down_m: float) -> bool:
        mode, sticks = self.modes.flown, self.commander.sticks.sticks
        if mode is Mode.OFFBOARD:
            return isinstance(self._demand, TrajectorySetpoint) and wants_takeoff(self._demand, down_m)
        if mode in BY_STICKS:
            return sticks is not None and sticks.throttle > TAKEOFF_STICK
        return self.navigator.wants_takeoff

    def _detect_landing(self) -> None:
        was_landed, demand = self.detector.landed, self._demand
        asked_down_m_s = demand.velocity_ned_m_s[2] if isinstance(demand, TrajectorySetpoint) else None
        controls_climb = demand is None or isinstance(demand, TrajectorySetpoint)
        self.detector.update(self._estimate, self.arming.armed, asked_down_m_s, controls_climb)
        if not self.arming.armed or was_landed == self.detector.landed:
            return
        if was_landed:
            self.texts.say(Severity.INFO, "Takeoff detected")
            self.navigator.set_home_here()
        else:
            self.texts.say(Severity.INFO, "Landing detected")

    # --- what is shown -----------------------------------------------------------------------------------

    @property
    def landed_state(self) -> LandedState:
        """EXTENDED_SYS_STATE.landed_state."""
        if self.detector.landed:
            return LandedState.ON_GROUND
        target = self.navigator.target
        if target is not None and target.kind is Kind.TAKEOFF:
            return LandedState.TAKING_OFF
        return LandedState.LANDING if target is not None and target.kind is Kind.LAND else LandedState.IN_AIR
