"""Telemetry logs (.tlog): ours, MAVProxy's and QGroundControl's, with any number of systems on them."""

import struct
from collections import Counter
from pathlib import Path

from companion.link.vehicle import Identity, identify, is_autopilot
from companion.mavlink.decode import Decoder
from companion.mavlink.packet import message_id_of, payload_of, source_of
from companion.messages import Heartbeat, MessageId
from companion.shell.tlog import read_tlog
from rebound_cli.logs.kind import other_arms
from rebound_cli.logs.log import Demand, Heard, Log, LogError, checked

Packets = list[tuple[int, bytes]]
Source = tuple[int, int]

# time_boot_ms; position, velocity, acceleration; yaw and its rate; type mask, frame. Zeros at the end are left out.
_TARGET = struct.Struct("<I11fHB")
_MASK_POSITION, _MASK_VELOCITY, _MASK_VELOCITY_DOWN = 0x07, 0x38, 0x20


def read_telemetry(path: Path) -> Log:
    """Raises LogError."""
    try:
        packets = list(read_tlog(path))
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror or error}.") from error
    if not packets:
        raise LogError(f"{path}: not a telemetry log: no MAVLink packet with a time stamp in it.")
    vehicle, others = _vehicle(path, packets)
    source = (vehicle.system_id, vehicle.component_id)
    decoder = Decoder()
    decoder.listen_to(*source)
    heard: list[Heard] = []
    for at_us, packet in packets:
        if source_of(packet) != source:
            continue
        if message_id_of(packet) == MessageId.POSITION_TARGET_LOCAL_NED:
            heard.append(Heard(at_us, _demand(packet)))
            continue
        heard.extend(Heard(at_us, sample) for _, sample in decoder.feed(packet) if sample is not None)
    kinds = {message_id_of(packet) for _, packet in packets if source_of(packet) == source}
    losses = [f"{MessageId(number).name} is not in it" for number in _WANTED if number not in kinds]
    if others:
        losses.append(f"more than one PX4 vehicle speaks in it: system {vehicle.system_id} was taken, not {others}")
    if MessageId.HIGHRES_IMU not in kinds:
        raise LogError(
            f"{path}: no HIGHRES_IMU from system {vehicle.system_id} in it; PX4 sends none to a ground station unless "
            "asked (MAV_x_MODE, or SET_MESSAGE_INTERVAL 105)."
        )
    name = f"PX4 {vehicle.vehicle_type}, system {vehicle.system_id}"
    return checked(
        Log(path, name, packets[0][0], tuple(heard), tuple(losses), other_arms=other_arms(vehicle.vehicle_type))
    )


_WANTED = (
    MessageId.LOCAL_POSITION_NED,
    MessageId.ATTITUDE_QUATERNION,
    MessageId.EXTENDED_SYS_STATE,
    MessageId.ATTITUDE_TARGET,
    MessageId.ODOMETRY,
    MessageId.VIBRATION,
)


def _vehicle(path: Path, packets: Packets) -> tuple[Identity, str]:
    """The PX4 multicopter with the most IMU samples, and the other ones by number."""
    decoder = Decoder()
    beats: dict[int, Heartbeat] = {}
    imu: Counter[int] = Counter()
    for _, packet in packets:
        number = message_id_of(packet)
        if number == MessageId.HIGHRES_IMU:
            imu[source_of(packet)[0]] += 1
        elif number == 0:
            for _, sample in decoder.feed(packet):
                if isinstance(sample, Heartbeat) and is_autopilot(sample):
                    beats[sample.system_id] = sample
    found = [identify(beat) for beat in beats.values()]
    vehicles = [identity for identity in found if isinstance(identity, Identity)]
    if not vehicles:
        why = next((refusal for refusal in found if isinstance(refusal, str)), "no autopilot's heartbeat is in it")
        raise LogError(f"{path}: no PX4 multicopter speaks in it: {why}.")
    chosen = max(vehicles, key=lambda identity: imu[identity.system_id])
    return chosen, ", ".join(str(v.system_id) for v in vehicles if v is not chosen)


def _demand(packet: bytes) -> Demand:
    payload = payload_of(packet).ljust(_TARGET.size, b"\0")
    time_ms, x, y, z, vx, vy, vz, *_, mask, _ = _TARGET.unpack_from(payload)
    position = None if mask & _MASK_POSITION or x != x or y != y or z != z else (x, y, z)
    velocity = None if mask & _MASK_VELOCITY or vx != vx or vy != vy or vz != vz else (vx, vy, vz)
    down = None if mask & _MASK_VELOCITY_DOWN or vz != vz else vz
    return Demand(time_ms * 1000, position, velocity, down)
