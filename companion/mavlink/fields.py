"""MAVLink messages as names and fields, for programs that hand them over so: the same samples as from bytes."""

import math
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from companion.mavlink.decode import GUARD_CONVERTERS
from companion.mavlink.encode import Encoder
from companion.mavlink.frequent import FREQUENT
from companion.messages import Outgoing, Sample

Fields = Mapping[str, Any]


def _reader(message_id: int) -> Callable[[Any], Sample | None]:
    frequent = FREQUENT.get(message_id)
    return GUARD_CONVERTERS[message_id] if frequent is None else frequent.from_message


_READERS: dict[str, Callable[[Any], Sample | None]] = {
    dialect.mavlink_map[message_id].msgname: _reader(message_id) for message_id in (*FREQUENT, *GUARD_CONVERTERS)
}
# Names of the messages that become samples.
HEARD = frozenset(_READERS)


def command_name(number: int) -> str:
    """A command as MAVLink calls it, for people: "176 (DO_SET_MODE)"."""
    entry = dialect.enums["MAV_CMD"].get(number)
    return str(number) if entry is None else f"{number} ({entry.name.removeprefix('MAV_CMD_')})"


def sample_from(name: str, source: tuple[int, int], fields: Fields) -> Sample | None:
    """The sample; None where the message has none, or its fields are not those of this dialect.

    A None field is NaN. An answer to a command is taken as one to ours: who asked is not told apart here.
    """
    reader = _READERS.get(name)
    if reader is None:
        return None
    values = {key: math.nan if value is None else value for key, value in fields.items()}
    if name == "COMMAND_ACK":
        values["target_component"] = 0
    system_id, component_id = source
    message = SimpleNamespace(**values, get_srcSystem=lambda: system_id, get_srcComponent=lambda: component_id)
    try:
        return reader(message)
    except (AttributeError, TypeError, ValueError):
        return None


def fields_from(encoder: Encoder, outgoing: Outgoing) -> list[tuple[str, dict[str, Any]]]:
    """Name and fields of each message that it takes; NaN as None."""
    found = []
    for message in encoder.messages(outgoing):
        values = {name: _plain(getattr(message, name)) for name in message.fieldnames}
        found.append((message.get_type(), values))
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value.decode() if isinstance(value, bytes) else value
