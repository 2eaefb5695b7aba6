"""State to bytes: each message filled as PX4's stream of that name fills it.

Source: PX4's mavlink/streams/*.hpp. All times are the vehicle's boot clock.
"""

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, TypeAlias

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.messages import CommandAck, Identity, StatusText
from sim_vehicle.autopilot.mode_numbers import NUMBERS, base_mode
from sim_vehicle.control.setpoint import AttitudeSetpoint, RatesSetpoint, TrajectorySetpoint
from sim_vehicle.estimator.estimate import Estimate, roll_pitch_of, yaw_of
from sim_vehicle.geography import Place
from sim_vehicle.hil.messages import Air
from sim_vehicle.mavlink import framing
from sim_vehicle.mavlink.framing import HEADER, MAGIC, flattened
from sim_vehicle.mavlink.telemetry import Telemetry

# One of pymavlink's, which carry no types, or a layout and the payload, zeros at its end included; only
# `Encoder.packet` looks inside.
Message: TypeAlias = Any

NAN = math.nan
_NO_OFFSET = (0.0, 0.0, 0.0, 0.0)
_TEXT_BYTES = 50
# HIGHRES_IMU's and HIL_SENSOR's fields_updated: accelerometer and gyroscope; magnetometer; pressure, its altitude and
# temperature.
INERTIAL_FIELDS, MAGNETIC_FIELDS, AIR_FIELDS = 0x3F, 0x1C0, 0x1A00


class Encoder:
    """Packets of this vehicle in one sequence of numbers, and those that wait to be sent."""

    def __init__(self, us: Identity) -> None:
        self._link = dialect.MAVLink(None, srcSystem=us.system, srcComponent=us.component)
        self._waiting: list[bytes] = []

    def send(self, message: Message) -> None:
        """Make a packet of the message, to be taken."""
        self._waiting.append(self.packet(message))

    def forward(self, packet: bytes) -> None:
        """Send a packet as it is, somebody else's."""
        self._waiting.append(packet)

    def take(self) -> tuple[bytes, ...]:
        """All packets since the last call, in order."""
        packets = tuple(self._waiting)
        self._waiting.clear()
        return packets

    def packet(self, message: Message) -> bytes:
        """The message as a packet."""
        link = self._link
        kind: Any = type(message)
        if kind is not tuple and (flat := flattened(kind)) is not None:
            layout, fields_of = flat
            kind, message = tuple, (layout, layout.pack(*fields_of(message)))
        if kind is tuple and not link.signing.sign_outgoing:
            layout, payload = message
            # Zeros at the end of a payload are left out, but for its first byte.
            sent = payload.rstrip(b"\0") or payload[:1]
            header = HEADER.pack(len(sent), 0, link.seq, link.srcSystem, link.srcComponent)
            link.seq = (link.seq + 1) & 0xFF
            framed: bytes = header + layout.number_bytes + sent
            checksum: int = mcrf4xx(framed + layout.checked)
            return MAGIC + framed + checksum.to_bytes(2, "little")
        packet: bytes
        if kind is tuple:
            # pymavlink's whole packet, which has the signature.
            layout, payload = message
            theirs = dialect.MAVLink_message(layout.number, layout.name)
            packet = theirs._pack(link, layout.checked[0], payload, False)
        else:
            packet = message.pack(link)
        link.seq = (link.seq + 1) & 0xFF
        return packet

    def sign(self, key: bytes, link_number: int, time_stamp: int) -> None:
        """From now on sign with this key and no earlier time stamp."""
        signing = self._link.signing
        signing.secret_key, signing.sign_outgoing = key, True
        signing.link_id, signing.timestamp = link_number, max(signing.timestamp, time_stamp)


def heartbeat(state: Telemetry) -> Message:
    autopilot = state.autopilot
    mode = autopilot.modes.flown
    return dialect.MAVLink_heartbeat_message(
        int(state.autopilot.parameters["MAV_TYPE"]),
        dialect.MAV_AUTOPILOT_PX4,
        base_mode(mode, autopilot.arming.armed),
        NUMBERS[mode].custom_mode,
        autopilot.commander.system_status,
        3,
    )


def highres_imu(state: Telemetry) -> Message:
    sample, (field_is_new, air_is_new) = state.sample, state.renewed
    inertial = (*sample.specific_force_frd_m_s2, *sample.angular_velocity_frd_rad_s)
    fields = INERTIAL_FIELDS | (MAGNETIC_FIELDS if field_is_new else 0)
    fields |= AIR_FIELDS if air_is_new and state.slow.air is not None else 0
    slow = (*state.slow.magnetic_field_frd_gauss, *air_fields(state.slow.air))
    return framing.HIGHRES_IMU, framing.HIGHRES_IMU.pack(sample.time_boot_us, *inertial, *slow, fields, 0)


def air_fields(air: Air | None) -> tuple[float, float, float, float]:
    """HIGHRES_IMU's and HIL_SENSOR's: pressure, no difference of pressures, its altitude, temperature."""
    return (0.0,) * 4 if air is None else (air.pressure_hpa, 0.0, air.altitude_m, air.temperature_c)


def local_position_ned(state: Telemetry) -> Message:
    estimate = state.published
    return framing.LOCAL_POSITION_NED, framing.LOCAL_POSITION_NED.pack(
        boot_ms(estimate), *estimate.position_ned_m, *estimate.velocity_ned_m_s
    )


def attitude(state: Telemetry) -> Message:
    sample = state.sample
    angles = (*roll_pitch_of(sample.attitude_wxyz), yaw_of(sample.attitude_wxyz))
    return framing.ATTITUDE, framing.ATTITUDE.pack(boot_ms(sample), *angles, *sample.angular_velocity_frd_rad_s)


def attitude_quaternion(state: Telemetry) -> Message:
    sample = state.sample
    return framing.ATTITUDE_QUATERNION, framing.ATTITUDE_QUATERNION.pack(
        boot_ms(sample), *sample.attitude_wxyz, *sample.angular_velocity_frd_rad_s, *_NO_OFFSET
    )


def odometry(state: Telemetry) -> Message:
    """Velocity is NED too (child frame 1), unlike what the message's definition suggests."""
    estimate = state.published
    return framing.ODOMETRY, framing.ODOMETRY.pack(
        estimate.time_boot_us,
        *estimate.position_ned_m,
        *estimate.attitude_wxyz,
        *estimate.velocity_ned_m_s,
        *estimate.angular_velocity_frd_rad_s,
        *diagonal_covariance(state.position_variance_m2, state.attitude_variance_rad2),
        *diagonal_covariance(state.velocity_variance_m2_s2, 0.0),
        dialect.MAV_FRAME_LOCAL_NED,
        dialect.MAV_FRAME_LOCAL_NED,
        estimate.reset_counter & 0xFF,
        dialect.MAV_ESTIMATOR_TYPE_AUTOPILOT,
        0,
    )


def extended_sys_state(state: Telemetry) -> Message:
    return dialect.MAVLink_extended_sys_state_message(dialect.MAV_VTOL_STATE_UNDEFINED, state.autopilot.landed_state)


def vibration(state: Telemetry) -> Message:
    """What was clipped alone."""
    clipped = sum(state.sample.clipping_counts)
    return dialect.MAVLink_vibration_message(state.sample.time_boot_us, 0.0, 0.0, 0.0, clipped, 0, 0)


def timesync(state: Telemetry) -> Message:
    return dialect.MAVLink_timesync_message(0, state.sample.time_boot_us * 1000)


def current_mode(state: Telemetry) -> Message:
    shown, intended = NUMBERS[state.autopilot.modes.flown], NUMBERS[state.autopilot.modes.intended]
    return dialect.MAVLink_current_mode_message(shown.standard_mode, shown.custom_mode, intended.custom_mode)


def position_target_local_ned(state: Telemetry) -> Message | None:
    """What the position control flies, nothing where it does not; all ignored while the motors idle or stand."""
    applied = state.autopilot.applied
    if isinstance(applied, AttitudeSetpoint | RatesSetpoint):
        return None
    if not isinstance(applied, TrajectorySetpoint):
        return dialect.MAVLink_position_target_local_ned_message(
            boot_ms(state.published), dialect.MAV_FRAME_LOCAL_NED, 0xDFF, *([NAN] * 11)
        )
    values = (*applied.position_ned_m, *applied.velocity_ned_m_s, *applied.acceleration_ned_m_s2)
    mask = sum(1 << bit for bit, value in enumerate(values) if value is None)
    mask |= (applied.yaw_rad is None) << 10 | (applied.yaw_rate_rad_s is None) << 11
    return dialect.MAVLink_position_target_local_ned_message(
        boot_ms(state.published),
        dialect.MAV_FRAME_LOCAL_NED,
        mask,
        *(NAN if value is None else value for value in (*values, applied.yaw_rad, applied.yaw_rate_rad_s)),
    )


def command_ack(ack: CommandAck) -> Message:
    return dialect.MAVLink_command_ack_message(ack.command, ack.result, 0, 0, ack.target_system, ack.target_component)


def status_texts(text: StatusText, number: int) -> Iterator[Message]:
    """The text in as many messages as its length needs; as in PX4 it ends in a tab."""
    raw = text.text.encode() + b"\t"
    for sequence, start in enumerate(range(0, len(raw), _TEXT_BYTES)):
        yield dialect.MAVLink_statustext_message(
            text.severity, raw[start : start + _TEXT_BYTES], number & 0xFFFF, sequence
        )


def boot_ms(estimate: Estimate) -> int:
    return (estimate.time_boot_us // 1000) & 0xFFFFFFFF


def units_of(place: Place) -> tuple[int, int, int]:
    """Latitude and longitude in 1e-7 degrees, altitude in millimetres."""
    return round(1e7 * place.latitude_deg), round(1e7 * place.longitude_deg), round(1e3 * place.altitude_m)


@lru_cache(maxsize=2)
def diagonal_covariance(first: float, second: float) -> tuple[float, ...]:
    """Upper right triangle of a 6x6 matrix, row by row, with ``first`` and ``second`` three times each."""
    triangle = [0.0] * 21
    triangle[0] = triangle[6] = triangle[11] = first
    triangle[15] = triangle[18] = triangle[20] = second
    return tuple(triangle)
