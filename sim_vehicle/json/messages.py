"""What ArduPilot's SITL sends to a model of kind JSON, and the answer (libraries/SITL/SIM_JSON.h)."""

import math
import struct
from dataclasses import dataclass

from sim_vehicle.quantities import Quaternion, Vector3

# Magic number, frames a second, count of frames, sixteen pulses.
_PULSES = struct.Struct("<HHI16H")
_MAGIC = 18_458
# A pulse of the motors, microseconds: MOT_PWM_MIN and MOT_PWM_MAX.
STOPPED_US, FULL_US = 1000, 2000
# ArduPilot cuts each step to whole microseconds: one that is a rounding error short of them would lose a whole one.
_LONGER = 1.0 + 2e-6


@dataclass(frozen=True, slots=True)
class Pulses:
    """ArduPilot's answer to a state."""

    count: int
    """Of the frame. A SITL that has waited for a second says the same once more."""
    widths_us: tuple[int, ...]
    """0 of an output that does not run yet."""

    def motor_fractions(self, motors: int) -> tuple[float, ...]:
        """Thrust of each motor over its greatest: linear in the pulse, as MOT_THST_EXPO 0 has it."""
        widths = self.widths_us[:motors]
        return tuple(min(max((width - STOPPED_US) / (FULL_US - STOPPED_US), 0.0), 1.0) for width in widths)


def pulses_from(packet: bytes) -> Pulses | None:
    """None of a packet that is another's."""
    if len(packet) != _PULSES.size:
        return None
    magic, _, count, *widths_us = _PULSES.unpack(packet)
    return Pulses(count, tuple(widths_us)) if magic == _MAGIC else None


def state_line(
    time_us: int,
    angular_velocity_frd_rad_s: Vector3,
    specific_force_frd_m_s2: Vector3,
    position_ned_m: Vector3,
    attitude_wxyz: Quaternion,
    velocity_ned_m_s: Vector3,
) -> bytes:
    """The inertial sensor's sample, and the truth of which ArduPilot makes its other sensors, as they are sent.

    ArduPilot finds keys by the first place of their letters: the order counts.
    """
    gyro, force = _list(angular_velocity_frd_rad_s), _list(specific_force_frd_m_s2)
    place, turn, way = _list(position_ned_m), _list(attitude_wxyz), _list(velocity_ned_m_s)
    text = f'{{"timestamp":{time_us * 1e-6 * _LONGER:.9f},"imu":{{"gyro":{gyro},"accel_body":{force}}},'
    return f'\n{text}"position":{place},"quaternion":{turn},"velocity":{way}}}\n'.encode()


def _list(numbers: Vector3 | Quaternion) -> str:
    """ArduPilot reads no exponent's sign as one."""
    assert all(map(math.isfinite, numbers)), "a body that is nowhere is not told"
    return f"[{','.join(f'{number:.7f}' for number in numbers)}]"
