"""Any log by its path. Telemetry logs (.tlog) of any program are read here, with any number of systems on them."""

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from companion.link.vehicle import Identity, identify, is_autopilot
from companion.mavlink.decode import Decoder
from companion.mavlink.packet import message_id_of, source_of
from companion.mavlink.readers import GUARD_READERS
from companion.messages import Heartbeat, MessageId
from companion.shell.tlog import read_tlog
from rebound_cli.logs.log import LONGEST_US, WANTED, Log, LogError, LoggedSample

_ULOG_MAGIC, _DATAFLASH_MAGIC = b"ULog", b"\xa3\x95"


def read_log(path: Path) -> Log:
    """A .ulg or .bin by its first bytes, whatever its name; by its name else. Raises LogError, OSError."""
    from rebound_cli.logs.dataflash import read_dataflash
    from rebound_cli.logs.ulog import read_ulog

    with path.open("rb") as file:
        magic = file.read(len(_ULOG_MAGIC))
    if not magic:
        raise LogError(f"{path}: the file is empty.")
    if magic == _ULOG_MAGIC or path.suffix == ".ulg":
        log = read_ulog(path)
    elif magic.startswith(_DATAFLASH_MAGIC) or path.suffix.lower() in (".bin", ".log"):
        log = read_dataflash(path)
    else:
        log = read_telemetry(path)
    if len(log.imu()) < 2:
        raise LogError(f"{path}: no IMU samples in it; a collision cannot be looked for without them.")
    return log


def read_telemetry(path: Path) -> Log:
    """Raises LogError."""
    packets = list(_going_on(read_tlog(path)))
    if not packets:
        raise LogError(f"{path}: not a telemetry log: no MAVLink packet with a time stamp in it.")
    vehicle, others = _vehicle(path, packets)
    source, decoder = (vehicle.system_id, vehicle.component_id), Decoder(GUARD_READERS)
    decoder.listen_to(*source, vehicle.autopilot)
    heard: list[LoggedSample] = []
    kinds: set[int] = set()
    for at_us, packet in packets:
        if source_of(packet) != source:
            continue
        kinds.add(message_id_of(packet))
        heard.extend(LoggedSample(at_us, sample) for _, sample in decoder.feed(packet) if sample is not None)
    if not kinds & {MessageId.HIGHRES_IMU, vehicle.autopilot.lesser_imu}:
        raise LogError(
            f"{path}: no HIGHRES_IMU from system {vehicle.system_id} in it; PX4 sends none to a ground station unless "
            "asked (MAV_x_MODE, or SET_MESSAGE_INTERVAL 105)."
        )
    losses = [f"{wanted.name} is not in it" for wanted in WANTED if wanted not in kinds]
    if others:
        losses.append(f"more than one vehicle speaks in it: system {vehicle.system_id} was taken, not {others}")
    name = f"{vehicle.autopilot.name} {vehicle.vehicle_type}, system {vehicle.system_id}"
    return Log(path, name, packets[0][0], tuple(heard), tuple(losses), is_filtered=vehicle.autopilot.filters_imu)


def _going_on(packets: Iterable[tuple[int, bytes]]) -> Iterator[tuple[int, bytes]]:
    """With times that never go back: whoever wrote the log may have set a clock, and a stamp may be damaged."""
    now_us = stamped_us = 0
    for at_us, packet in packets:
        passed_us, stamped_us = at_us - stamped_us, at_us
        now_us = at_us if now_us == 0 else now_us + (passed_us if 0 <= passed_us < LONGEST_US else 0)
        yield now_us, packet


def _vehicle(path: Path, packets: Iterable[tuple[int, bytes]]) -> tuple[Identity, str]:
    """The multicopter with the most IMU samples, and the other ones by number."""
    decoder = Decoder()
    beats: dict[int, Heartbeat] = {}
    imu: Counter[int] = Counter()
    for _, packet in packets:
        number = message_id_of(packet)
        if number in (MessageId.HIGHRES_IMU, MessageId.RAW_IMU):
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
