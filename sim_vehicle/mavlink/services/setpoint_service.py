"""What steers the flight on a link: setpoints, sticks, targets to follow."""

from math import isfinite

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.messages import AttitudeTarget, FollowTarget, PositionTarget, StickInput
from sim_vehicle.geography import Place
from sim_vehicle.mavlink.services.service import Board, Channel, Service
from sim_vehicle.quantities import Axis3

_FORCE_BIT, _YAW_IGNORED, _YAW_RATE_IGNORED = 0x200, 0x400, 0x800
_NO_THRUST, _NO_ATTITUDE = 0x40, 0x80
_FULL_STICK = 1000


def position_target(packet: dialect.MAVLink_set_position_target_local_ned_message) -> PositionTarget:
    mask = packet.type_mask
    return PositionTarget(
        frame=packet.coordinate_frame,
        position_m=_axes(mask, packet.x, packet.y, packet.z),
        velocity_m_s=_axes(mask >> 3, packet.vx, packet.vy, packet.vz),
        acceleration_m_s2=_axes(mask >> 6, packet.afx, packet.afy, packet.afz),
        yaw_rad=_value(mask & _YAW_IGNORED, packet.yaw),
        yaw_rate_rad_s=_value(mask & _YAW_RATE_IGNORED, packet.yaw_rate),
        is_force=bool(mask & _FORCE_BIT),
    )


def attitude_target(packet: dialect.MAVLink_set_attitude_target_message) -> AttitudeTarget:
    mask = packet.type_mask
    rates = _axes(mask, packet.body_roll_rate, packet.body_pitch_rate, packet.body_yaw_rate)
    w, x, y, z = packet.q
    thrust = _value(mask & _NO_THRUST, packet.thrust)
    return AttitudeTarget(None if mask & _NO_ATTITUDE else (w, x, y, z), rates, thrust)


def stick_input(packet: dialect.MAVLink_manual_control_message, source: object) -> StickInput:
    """Values out of range count as centred; the throttle goes from 0 to 1000."""
    throttle = packet.z / (_FULL_STICK / 2) - 1.0 if 0 <= packet.z <= _FULL_STICK else 0.0
    return StickInput(_stick(packet.y), _stick(packet.x), throttle, _stick(packet.r), source)


def _stick(value: int) -> float:
    return value / _FULL_STICK if abs(value) <= _FULL_STICK else 0.0


def follow_target(packet: dialect.MAVLink_follow_target_message) -> FollowTarget:
    v_north, v_east, v_down = (value if isfinite(value) else 0.0 for value in packet.vel)
    return FollowTarget(Place(packet.lat * 1e-7, packet.lon * 1e-7, packet.alt), (v_north, v_east, v_down))


def _axes(mask: int, x: float, y: float, z: float) -> Axis3:
    """The mask's lowest bits leave an axis out."""
    return _value(mask & 1, x), _value(mask & 2, y), _value(mask & 4, z)


def _value(ignored: int, value: float) -> float | None:
    return None if ignored or not isfinite(value) else value


class SetpointService(Service):
    """Hands them to the autopilot, whatever the mode; PX4 answers none of them."""

    def __init__(self, link: Channel, board: Board) -> None:
        receive = board.autopilot.receive
        self.handlers = {
            69: lambda packet: receive(stick_input(packet, link)),
            82: lambda packet: receive(attitude_target(packet)),
            84: lambda packet: receive(position_target(packet)),
            # One without a height is none.
            144: lambda packet: receive(follow_target(packet)) if isfinite(packet.alt) else None,
        }
