"""What the service runs: /etc/rebound/service.yaml, and beside it the guard's settings or the mission."""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from companion.errors import AddressError
from companion.guard.config import GuardConfig
from companion.shell.addresses import serial_device
from companion.written import Written
from rebound_cli.documents import DocumentError, parse_document, validated
from rebound_cli.inputs import mission_from

FOLDER = "etc/rebound"
SETTINGS_NAME = "service.yaml"
# The UART of a Raspberry Pi at the rate of PX4's TELEM2 for a companion (SER_TEL2_BAUD).
DEFAULT_URL = "serial:///dev/ttyAMA0:921600"
# What udev lets a device's name consist of; anything else would have to be quoted in its rules.
_DEVICE = re.compile(r"/dev/[A-Za-z0-9#+.:=@_/-]+")
_PLAIN = r"^[^\x00-\x1f\x7f]*$"


def _address(url: str) -> str:
    try:
        device = serial_device(url)
    except AddressError as error:
        raise ValueError(str(error)) from error
    if device is not None and (_DEVICE.fullmatch(device) is None or ".." in device):
        raise ValueError(f"{device!r} is not the name of a device, such as /dev/ttyAMA0")
    return url


Plain = Annotated[str, Field(strict=True, min_length=1, pattern=_PLAIN)]


class ServiceSettings(Written):
    """/etc/rebound/service.yaml; a key that a new version brings is optional."""

    run: Literal["guard", "mission"] = "guard"
    connect: Annotated[Plain, AfterValidator(_address)] = DEFAULT_URL
    peer: Plain | None = None
    signing_key: Plain | None = None

    @property
    def device(self) -> str | None:
        """The serial device; None on a network."""
        return serial_device(self.connect)

    def arguments(self) -> Sequence[str]:
        """What the service runs, after `rebound`."""
        file = f"/{FOLDER}/{self.run}.yaml"
        first = ["guard", "--config", file] if self.run == "guard" else ["fly", file, "--yes"]
        options = {"--connect": self.connect, "--peer": self.peer, "--signing-key": self.signing_key}
        return [*first, *(word for name, value in options.items() if value is not None for word in (name, value))]


def settings_text(settings: ServiceSettings) -> str:
    """A file that says the same. A quoted text of JSON is one of YAML."""
    lines = [f"{key}: {json.dumps(value)}\n" for key, value in settings.model_dump(exclude_none=True).items()]
    return "# What the service runs. After a change: sudo rebound service install\n" + "".join(lines)


def check_run(kind: str, text: str, name: str) -> None:
    """The guard's settings or the mission, as the service will read them. Raises DocumentError."""
    document = parse_document(text, name)
    if kind == "guard":
        validated(GuardConfig, document, document.data)
        return
    obstacles = document.data.get("obstacles")
    file = obstacles.get("file") if isinstance(obstacles, dict) else None
    if isinstance(file, str) and not Path(file).is_absolute():
        place = document.place_of(("obstacles", "file"))
        raise DocumentError(f"{place}: obstacles.file: the mission is copied to /{FOLDER}; give the file's whole path.")
    mission_from(document)
