"""OFFBOARD: setpoints as they come, kept alive by their stream, flown only in their mode."""

from sim_vehicle.autopilot import offboard
from sim_vehicle.autopilot.flight_messages import AttitudeTarget, GlobalTarget
from sim_vehicle.autopilot.flight_tasks.target import Vector3
from sim_vehicle.autopilot.messages import PositionTarget, StatusText
from sim_vehicle.geography import Origin
from sim_vehicle.setpoint import FREE, Quaternion, Setpoint


class OffboardControl:
    """The last valid setpoint that came in OFFBOARD."""

    def __init__(self, signal: offboard.OffboardSignal, origin: Origin) -> None:
        self.demand: Setpoint = offboard.STOP
        self._signal = signal
        self._origin = origin

    def begin(self, last_demand: Setpoint | None) -> None:
        """The mode was entered: until a setpoint arrives the last demand goes on, or the vehicle stops."""
        self.demand = last_demand or offboard.STOP

    def take_position(
        self,
        target: PositionTarget | GlobalTarget,
        now_us: int,
        is_flown: bool,
        attitude_wxyz: Quaternion,
        home_ned_m: Vector3,
    ) -> StatusText | None:
        """Take a setpoint, valid or not, whatever the mode; why it was refused, where PX4 says so."""
        if isinstance(target, GlobalTarget):
            local = offboard.local_target(target, self._origin, home_ned_m)
        else:
            local = offboard.refusal(target) or target
        if not isinstance(local, PositionTarget):
            return local
        self._signal.heard(now_us, needs_place=(local.position_m, local.velocity_m_s) != (FREE, FREE))
        if is_flown:
            self.demand = offboard.trajectory_setpoint(local, attitude_wxyz)
        return None

    def take_attitude(self, target: AttitudeTarget, now_us: int, is_flown: bool) -> None:
        """SET_ATTITUDE_TARGET; one without attitude and rates is none at all."""
        demand = offboard.attitude_setpoint(target)
        if demand is None:
            return
        self._signal.heard(now_us, needs_place=False)
        if is_flown:
            self.demand = demand
