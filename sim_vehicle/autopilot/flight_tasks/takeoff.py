"""From armed to flying: the motors spin up, then the climb that is allowed grows from nothing.

Source: PX4's mc_pos_control/Takeoff/Takeoff.cpp and MulticopterPositionControl::Run. It applies in
every mode, offboard too: a vehicle leaves the ground some 2.4 s after it is armed with a climbing setpoint.
"""

from dataclasses import replace
from enum import IntEnum

from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.parameters.store import Parameters

GRAVITY_M_S2 = 9.80665


class TakeoffState(IntEnum):
    """In the order in which they are passed."""

    DISARMED = 0
    SPOOL_UP = 1
    READY = 2
    RAMP_UP = 3
    FLIGHT = 4


class Takeoff:
    """Decides what of a demand may reach the position control."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.state = TakeoffState.DISARMED
        self._since_us = 0

    def update(self, now_us: int, armed: bool, landed: bool, wants_takeoff: bool) -> None:
        """Move on; call whenever there is a new demand."""
        if not armed:
            self.state = TakeoffState.DISARMED
            return
        if self.state is TakeoffState.DISARMED:
            self.state, self._since_us = TakeoffState.SPOOL_UP, now_us
        if self.state is TakeoffState.SPOOL_UP and self._passed_s(now_us) >= self._parameters["COM_SPOOLUP_TIME"]:
            self.state = TakeoffState.READY
        if self.state is TakeoffState.READY and wants_takeoff:
            self.state, self._since_us = TakeoffState.RAMP_UP, now_us
        elif self.state is TakeoffState.RAMP_UP and self._passed_s(now_us) >= self._parameters["MPC_TKO_RAMP_T"]:
            self.state = TakeoffState.FLIGHT
        elif self.state is TakeoffState.FLIGHT and landed:
            self.state = TakeoffState.READY

    def skip(self, now_us: int, armed: bool, landed: bool) -> None:
        """The same for a demand that leaves out the position control: no ramp holds it back."""
        self.update(now_us, armed, landed, wants_takeoff=False)
        if self.state in (TakeoffState.READY, TakeoffState.RAMP_UP) and not landed:
            self.state = TakeoffState.FLIGHT

    def allowed(
        self, demand: TrajectorySetpoint | None, now_us: int, down_m: float, ground_contact: bool
    ) -> TrajectorySetpoint | None:
        """What the position control may fly of ``demand``; None lets the motors idle."""
        if demand is None or self.state < TakeoffState.RAMP_UP:
            return None
        if self.state is TakeoffState.FLIGHT:
            return None if ground_contact else demand
        climb_m_s = self._ramp_climb_m_s(now_us)
        if climb_m_s <= 0.0:
            return None
        return _with_climb_limited(demand, climb_m_s, down_m, self._parameters["MPC_Z_P"])

    def _ramp_climb_m_s(self, now_us: int) -> float:
        """From where the velocity control would take the whole weight off the motors to MPC_Z_VEL_MAX_UP."""
        start = -GRAVITY_M_S2 / self._parameters["MPC_Z_VEL_P_ACC"]
        ramp_s = self._parameters["MPC_TKO_RAMP_T"]
        progress = self._passed_s(now_us) / ramp_s if ramp_s > 0.0 else 1.0
        return start + progress * (self._parameters["MPC_Z_VEL_MAX_UP"] - start)

    def _passed_s(self, now_us: int) -> float:
        return (now_us - self._since_us) / 1e6


def wants_takeoff(demand: TrajectorySetpoint, down_m: float) -> bool:
    """Whether the demand lies above: by its height, or else by its velocity, or its acceleration."""
    height, velocity = demand.position_ned_m[2], demand.velocity_ned_m_s[2]
    acceleration = demand.acceleration_ned_m_s2[2]
    return (
        (height is not None and height < down_m)
        or (velocity is not None and velocity < 0.0)
        or (acceleration is not None and acceleration < 0.0)
    )


def _with_climb_limited(
    demand: TrajectorySetpoint, climb_m_s: float, down_m: float, height_p_per_s: float
) -> TrajectorySetpoint:
    north, east, height = demand.position_ned_m
    v_north, v_east, v_down = demand.velocity_ned_m_s
    if height is None and v_down is None:
        return demand
    asked_down_m_s = (v_down or 0.0) + (height_p_per_s * (height - down_m) if height is not None else 0.0)
    if asked_down_m_s >= -climb_m_s:
        return demand
    a_north, a_east, _ = demand.acceleration_ned_m_s2
    return replace(
        demand,
        position_ned_m=(north, east, None),
        velocity_ned_m_s=(v_north, v_east, -climb_m_s),
        acceleration_ned_m_s2=(a_north, a_east, None),
    )
