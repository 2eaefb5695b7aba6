"""Whether a setpoint that was sent lies inside what a mission allows: finite, in the fence, within the limits."""

import math

from bench.faults.packets import SETPOINT, decoded
from companion.core import FlightCore
from companion.mavlink.packet import message_id_of

# Single precision, and the fence's own nearest place.
_ROUNDING = 1.001
_ROUNDING_M = 0.01
_GRAVITY_M_S2 = 9.81
# POSITION_TARGET_TYPEMASK.
_XY, _Z, _VELOCITY, _ACCELERATION, _YAW = 0x003, 0x004, 0x038, 0x1C0, 0x400
_VALUES = ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz")


def outside(core: FlightCore, frame: bytes) -> str | None:
    """What is wrong with a setpoint; None for one inside, and for what is none."""
    message = decoded(frame) if message_id_of(frame) == SETPOINT else None
    if message is None:
        return None
    mask, fence, limits = message.type_mask, core.flight.mission.fence, core.flight.mission.limits
    origin = core.flight.origin_ned_m
    if origin is not None:
        # A reset of the vehicle's estimate moves its frame under what stands still.
        n, e, d = (o + s for o, s in zip(origin, core.resets.shift_ned_m, strict=True))
        origin = (n, e, d)
    asked = [getattr(message, name) for bit, name in enumerate(_VALUES) if not mask >> bit & 1]
    if not asked or not all(map(math.isfinite, asked)):
        return "not finite"
    if not mask & _YAW and not abs(message.yaw) <= math.pi * _ROUNDING:
        return f"yaw {message.yaw:g} rad"
    if not mask & _ACCELERATION:
        sideways = math.hypot(message.afx, message.afy)
        if sideways > _GRAVITY_M_S2 * math.tan(math.radians(limits.max_tilt_deg)) * _ROUNDING:
            return f"{sideways:.1f} m/s2 sideways"
        if abs(message.afz) > _GRAVITY_M_S2:
            return f"{message.afz:.1f} m/s2 up or down"
    speed_m_s = 0.0 if mask & _VELOCITY else math.hypot(message.vx, message.vy, message.vz)
    if speed_m_s > limits.max_speed_m_s * _ROUNDING:
        return f"{speed_m_s:.1f} m/s"
    if origin is None:
        return None
    if not mask & _XY and not fence.contains((message.x - origin[0]) * 0.999, (message.y - origin[1]) * 0.999):
        return "outside the fence"
    height_m = origin[2] - message.z
    if not mask & _Z and not -_ROUNDING_M <= height_m <= fence.max_height_m + _ROUNDING_M:
        return f"{height_m:.1f} m high"
    return None
