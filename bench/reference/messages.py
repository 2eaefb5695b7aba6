"""The page of MAVLink messages: what the companion reads, and what its encoder makes."""

import inspect
import re

from bench.reference.markdown import code, table
from companion.mavlink import encode, readers


def messages() -> dict[str, str]:
    read = [(code(name), ", ".join(map(code, reader._names))) for name, reader in sorted(readers._BY_NAME.items())]
    return {"received": table(("message", "fields"), read), "sent": ", ".join(map(code, sorted(_sent())))}


def _sent() -> set[str]:
    """By pymavlink's encoders and classes that the encoder names."""
    found = re.findall(r"\.(?:MAVLink_(\w+)_message|(\w+)_encode)\b", inspect.getsource(encode))
    return {(of_class or of_call).upper() for of_class, of_call in found}
