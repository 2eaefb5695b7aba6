"""Where the status socket is: the folder that systemd makes for a service, or that of a person's session."""

import os
from collections.abc import Mapping
from pathlib import Path

# Of a service that sets RuntimeDirectory=rebound; whoever asks has not that service's environment.
SERVICE_FOLDER = Path("/run/rebound")
SOCKET_NAME = "status.sock"


def socket_of_this_program(environment: Mapping[str, str] = os.environ) -> Path | None:
    """None where nobody gives programs a folder of their own, such as a login without a session."""
    if folder := environment.get("RUNTIME_DIRECTORY"):
        # systemd separates several by colons.
        return Path(folder.split(":")[0]) / SOCKET_NAME
    if folder := environment.get("XDG_RUNTIME_DIR"):
        return Path(folder) / "rebound" / SOCKET_NAME
    return None


def sockets_to_ask(environment: Mapping[str, str] = os.environ) -> list[Path]:
    own = socket_of_this_program(environment)
    service = SERVICE_FOLDER / SOCKET_NAME
    return [service] if own is None or own == service else [own, service]
