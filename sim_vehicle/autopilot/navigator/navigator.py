"""The modes that fly by themselves: which target each has, and when a mode is over.

Source: PX4's navigator (navigator_main.cpp, loiter.cpp, takeoff.cpp, land.cpp) at its rate of 20 Hz.
"""

from sim_vehicle.autopilot.flight_tasks.auto_flight import AutoFlight
from sim_vehicle.autopilot.flight_tasks.follow import Follow
from sim_vehicle.autopilot.flight_tasks.orbit import Orbit
from sim_vehicle.autopilot.flight_tasks.smoothing import stop_point
from sim_vehicle.autopilot.flight_tasks.target import (
    Arrival,
    Kind,
    NavigatorTarget,
    View,
    climbs_to,
    takeoff_acceptance,
)
from sim_vehicle.autopilot.messages import Severity, Texts
from sim_vehicle.autopilot.mission_protocol.mission_items import MissionType
from sim_vehicle.autopilot.mission_protocol.mission_store import MissionStore
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.autopilot.navigator.geofence import Geofence
from sim_vehicle.autopilot.navigator.mission import MissionFlight, problem_of
from sim_vehicle.autopilot.navigator.rtl import Return
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.geography import Origin
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Vector3

# The navigator listens to the position at 20 Hz.
PERIOD_US = 50_000
# MISSION_CURRENT calls the mission active in these (MavlinkMissionManager::update_mission_state).
_MISSION_IS_ACTIVE = (Mode.MISSION, Mode.TAKEOFF, Mode.LAND)


class Navigator:
    """The mode and the view in; targets, and setpoints towards them, out."""

    def __init__(
        self, parameters: Parameters, origin: Origin, missions: MissionStore, view: View, texts: Texts
    ) -> None:
        self.view = view
        self.fence = Geofence(parameters, origin, texts)
        self.mission = MissionFlight(missions, parameters, origin, texts)
        self._parameters = parameters
        self.origin = origin
        self.missions = missions
        self.flight = AutoFlight(parameters)
        self._return = Return(parameters, origin, texts)
        self.orbit = Orbit(parameters)
        self.follow = Follow(parameters, origin)
        self._arrival = Arrival()
        self._texts = texts
        self._mode = Mode.LOITER
        self._target = NavigatorTarget(Kind.IDLE, view.position_ned_m)
        self._takeoff_place: tuple[Vector3 | None, float | None] | None = None
        self._reposition: NavigatorTarget | None = None
        self._seen = (-1, -1, view.home_ned_m)
        self._updated_us = view.now_us
        self._holds_after_breach = False
        self.takeoff_is_over = False
        self.home_set_us = view.now_us

    # --- what commands ask for -----------------------------------------------------------------------------------

    def take_off_to(self, place_ned_m: Vector3 | None, down_m: float | None) -> None:
        """NAV_TAKEOFF: over which place and how high; None means here, and MIS_TAKEOFF_ALT."""
        self._takeoff_place = (place_ned_m, down_m)
        if self._mode is Mode.TAKEOFF and self.view.armed:
            self._begin_takeoff()

    def hold_at(self, target: NavigatorTarget) -> bool:
        """DO_REPOSITION, before the mode becomes LOITER; False where the fence forbids the place."""
        if not self.fence.allows(target.position_ned_m):
            return False
        self._reposition = target
        if self._mode is Mode.LOITER:
            self._take_reposition()
        return True

    def stop_place_ned_m(self) -> Vector3:
        """Where the vehicle would stand if it braked now."""
        return stop_point(self.view.position_ned_m, self.view.velocity_ned_m_s, self._parameters)

    # --- modes ---------------------------------------------------------------------------------------------------

    def enter(self, mode: Mode) -> None:
        """The mode that flies is another, or the vehicle was armed in it. Disarmed, nothing is begun."""
        previous, kept, self._mode = self._mode, self.target, mode
        if previous is Mode.MISSION and mode is not Mode.MISSION:
            self.mission.end()
        self.missions.progress.is_flown = mode in _MISSION_IS_ACTIVE
        self.takeoff_is_over = False
        if not self.view.armed:
            return
        self.flight.cruise_m_s = None
        # A hold goes on where one is held already, or where a takeoff leads to.
        keeps = mode is Mode.LOITER and kept is not None and (previous is Mode.TAKEOFF or kept.kind is Kind.HOLD)
        if not keeps:
            self.flight.start(self.view, at_rest=mode is Mode.TAKEOFF)
        if mode is Mode.LOITER:
            self._begin_hold(kept if keeps else None)
        elif mode is Mode.TAKEOFF:
            self._begin_takeoff()
        elif mode is Mode.RETURN:
            self._return.begin(self.view)
        elif mode in (Mode.LAND, Mode.DESCEND):
            self._target = NavigatorTarget(Kind.LAND, self.stop_place_ned_m())
        elif mode is Mode.MISSION:
            self.mission.begin(self.view)
        elif mode is Mode.ORBIT:
            self.orbit.start(self.view)
        elif mode is Mode.FOLLOW_TARGET:
            self.follow.start(self.view)

    def disarmed(self) -> None:
        """Nothing is flown any more."""
        self._target = NavigatorTarget(Kind.IDLE, self.view.position_ned_m)
        self.mission.disarmed()

    def _begin_hold(self, kept: NavigatorTarget | None) -> None:
        if self._reposition is not None:
            self._take_reposition()
        elif kept is not None:
            self._target = NavigatorTarget(Kind.HOLD, kept.position_ned_m, kept.yaw_rad)
        elif self.view.landed:
            self._target = NavigatorTarget(Kind.IDLE, self.view.position_ned_m)
        else:
            self._target = NavigatorTarget(Kind.HOLD, self.stop_place_ned_m())

    def _take_reposition(self) -> None:
        if self._reposition is not None and self.view.armed:
            self._target = self._reposition
        self._reposition = None
        self._holds_after_breach = False

    def _begin_takeoff(self) -> None:
        place, down_m = self._takeoff_place or (None, None)
        self._takeoff_place = None
        north, east, here_down_m = self.view.position_ned_m
        if place is not None:
            north, east, _ = place
        if down_m is None:
            height_m = self._parameters["MIS_TAKEOFF_ALT"]
            down_m = here_down_m - height_m
            self._texts.say(Severity.INFO, f"Using default takeoff altitude: {height_m:.1f} m")
        if down_m > here_down_m:
            down_m = here_down_m
            self._texts.say(Severity.CRITICAL, "Already higher than takeoff altitude")
        self._arrival.begin()
        self._target = NavigatorTarget(Kind.TAKEOFF, (north, east, down_m))

    # --- time ----------------------------------------------------------------------------------------------------

    def update(self) -> None:
        """What the navigator does at its own rate; call it whenever there is a new view."""
        view = self.view
        if view.now_us - self._updated_us < PERIOD_US:
            return
        self._updated_us = view.now_us
        self.notice_changes()
        self._reposition = None  # what was not flown at once is out of date, as after a refusal (loiter.cpp)
        was_breached = self.fence.breached
        self.fence.update(view, self._holds_after_breach)
        if self.fence.breached and not was_breached and view.armed:
            self._hold_after_breach()
        if self._mode is not Mode.LOITER and not self.fence.breached:
            self._holds_after_breach = False
        if not view.armed:
            return
        if self._mode is Mode.MISSION:
            self.mission.update(view)
        elif self._mode is Mode.RETURN:
            self._return.update(view)
        elif self._mode is Mode.TAKEOFF:
            accepts = takeoff_acceptance(self._target, view, self._parameters)
            self.takeoff_is_over = self._arrival.is_reached(self._target, accepts, view, self._parameters)

    def _hold_after_breach(self) -> None:
        """GF_ACTION 2 holds where the fence was found breached."""
        if self._parameters["GF_ACTION"] == _FENCE_HOLDS:
            self._holds_after_breach = True
            self._reposition = NavigatorTarget(Kind.HOLD, self.view.position_ned_m)
            if self._mode is Mode.LOITER:
                self._target, self._reposition = self._reposition, None

    def notice_changes(self) -> None:
        """Uploads, another current item, another home: all are judged anew."""
        missions = self.missions
        seen = (missions.mission_changes, missions.fence_changes, self.view.home_ned_m)
        if seen == self._seen:
            return
        before, self._seen = self._seen, seen
        if seen[1] != before[1] or seen[2] != before[2]:
            self.fence.load(missions.plan(MissionType.FENCE), self.view)
        self._check_mission()
        if seen[0] == before[0]:
            return
        if self._mode is Mode.MISSION and self.view.armed:
            self.mission.changed(self.view)
        else:
            self.mission.forget()

    def _check_mission(self) -> None:
        items = self.missions.mission
        problem = problem_of(items, self.origin, self.fence, self.view)
        self.missions.progress.valid = bool(items) and problem is None
        if problem is not None:
            self._texts.say(Severity.CRITICAL, problem)

    def demand(self, step_s: float) -> TrajectorySetpoint | None:
        """The next setpoint of the mode; None lets the motors idle."""
        view, mode = self.view, self._mode
        if mode is Mode.ORBIT:
            return self.orbit.demand(view, step_s)
        if mode is Mode.FOLLOW_TARGET:
            return self.follow.demand(view, step_s)
        if mode is Mode.DESCEND:
            return self.sink(step_s)
        target = self.target
        if target is None or (view.landed and target.kind is not Kind.TAKEOFF):
            return None
        return self.flight.demand(target, view, step_s)

    def sink(self, step_s: float) -> TrajectorySetpoint:
        """FlightTaskDescend: down at MPC_LAND_SPEED, whatever is below."""
        return self.flight.descend(self._target.position_ned_m, self.view, self._parameters["MPC_LAND_SPEED"], step_s)

    def sink_here(self) -> None:
        """Begin to sink where the vehicle can stop: a stick mode without sticks."""
        self.flight.start(self.view)
        self._target = NavigatorTarget(Kind.LAND, self.stop_place_ned_m())

    def set_home_here(self) -> None:
        """Where the vehicle is, is home: on arming and again on leaving the ground."""
        self.set_home(self.view.position_ned_m, self.view.yaw_rad)

    def set_home(self, position_ned_m: Vector3, yaw_rad: float) -> None:
        """Where RETURN leads to, and from where heights count."""
        self.view.home_ned_m, self.view.home_yaw_rad = position_ned_m, yaw_rad
        self.home_set_us = self.view.now_us

    # --- what is shown -------------------------------------------------------------------------------------------

    @property
    def wants_takeoff(self) -> bool:
        """Whether a vehicle on the ground is to leave it."""
        target = self.target
        return target is not None and target.kind is Kind.TAKEOFF and climbs_to(target, self.view, self._parameters)

    @property
    def target(self) -> NavigatorTarget | None:
        """Where the mode flies to; None for one that flies to no place."""
        if self._mode not in _BY_TARGET:
            return None
        if self._mode is Mode.MISSION:
            return self.mission.target
        return self._return.target if self._mode is Mode.RETURN else self._target

    @property
    def shown_target_ned_m(self) -> Vector3 | None:
        """POSITION_TARGET_GLOBAL_INT's place: the target's, in a mode that has one."""
        target = self.target
        return None if target is None or target.kind is Kind.IDLE else target.position_ned_m


_FENCE_HOLDS = 2
_BY_TARGET = (Mode.LOITER, Mode.TAKEOFF, Mode.RETURN, Mode.MISSION, Mode.LAND)
