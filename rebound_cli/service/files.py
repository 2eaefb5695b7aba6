"""The service's files: its settings in /etc/rebound, and what follows from them: the unit, udev's rules, the user."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from companion.errors import AddressError
from companion.shell.connections.addresses import parsed
from companion.strict_model import StrictModel
from rebound_cli import exit_codes
from rebound_cli.flights.kept import SERVICE_RUNS

FOLDER = "etc/rebound"
UNIT_NAME = "rebound.service"
UNIT = f"etc/systemd/system/{UNIT_NAME}"
UDEV = "etc/udev/rules.d/90-rebound.rules"
SYSUSERS = "etc/sysusers.d/rebound.conf"
USER = "rebound"
STATE_FOLDER = SERVICE_RUNS.parent

# The UART of a Raspberry Pi at the rate of PX4's TELEM2 for a companion (SER_TEL2_BAUD).
DEFAULT_URL = "serial:///dev/ttyAMA0:921600"
# What udev lets a device's name consist of; anything else would have to be quoted in its rules.
_DEVICE = re.compile(r"/dev/[A-Za-z0-9#+.:=@_/-]+")
# The release of systemd that brought RestartSteps and RestartMaxDelaySec; older ones complain of them.
_BACK_OFF_SINCE = 254
# Linux's numbers of USB serial ports (devices.txt). A port that is plugged in again may have another name.
_USB_MAJORS = {"ttyACM": 166, "ttyUSB": 188}
_BY_ID = "/dev/serial/by-id/"
_NO_NETWORK = "PrivateNetwork=yes\nIPAddressDeny=any\nRestrictAddressFamilies=AF_UNIX"
_UNIT = Path(__file__).with_name(UNIT_NAME).read_text(encoding="utf-8")
_WRITTEN_BY = _UNIT.partition("\n")[0]
SYSUSERS_TEXT = f'{_WRITTEN_BY}\nu {USER} - "Rebound" {STATE_FOLDER}\n'


def _address(url: str) -> str:
    try:
        _, scheme, device, _ = parsed(url)
    except AddressError as error:
        raise ValueError(str(error)) from error
    if scheme == "serial" and (_DEVICE.fullmatch(device) is None or ".." in device):
        raise ValueError(f"{device!r} is not the name of a device, such as /dev/ttyAMA0")
    return url


Plain = Annotated[str, Field(strict=True, min_length=1, pattern=r"^[^\x00-\x1f\x7f]*$")]


class ServiceSettings(StrictModel):
    """/etc/rebound/service.yaml; a key that a new version brings is optional."""

    run: Literal["guard", "mission"] = "guard"
    connect: Annotated[Plain, AfterValidator(_address)] = DEFAULT_URL
    peer: Plain | None = None
    signing_key: Plain | None = None

    @property
    def device(self) -> str | None:
        """The serial device; None on a network."""
        address = parsed(self.connect)
        return address.host if address.scheme == "serial" else None

    def arguments(self) -> Sequence[str]:
        """What the service runs, after `rebound`."""
        file = f"/{FOLDER}/{self.run}.yaml"
        # A mission does not wait: it would arm a vehicle that appears hours after the person has started it.
        first = ["guard", "--config", file, "--wait"] if self.run == "guard" else ["fly", file, "--yes"]
        options = {"--connect": self.connect, "--peer": self.peer, "--signing-key": self.signing_key}
        return [*first, *(word for name, value in options.items() if value is not None for word in (name, value))]

    def text(self) -> str:
        """A file that says the same. A quoted text of JSON is one of YAML."""
        lines = [f"{key}: {json.dumps(value)}\n" for key, value in self.model_dump(exclude_none=True).items()]
        return "# What the service runs. After a change: sudo rebound service install\n" + "".join(lines)


@dataclass(frozen=True, slots=True)
class PlannedFile:
    """A file below the system's root; a kept one is there already with this text."""

    path: str
    text: str
    is_kept: bool = False
    says_otherwise: bool = False  # than what was asked for


def udev_text(device: str) -> str:
    """For one port: no modem is looked for on it, and an FTDI chip passes on each byte within 1 ms, not 16."""
    name = device.removeprefix("/dev/")
    port = f'KERNEL=="{name}"' if name.startswith("tty") else f'SYMLINK=="{name}"'
    rule = f'ACTION!="remove", SUBSYSTEM=="tty", {port}'
    return f"""{_WRITTEN_BY}
{rule}, ENV{{ID_MM_PORT_IGNORE}}="1"
{rule}, DRIVERS=="ftdi_sio", ATTR{{device/latency_timer}}="1"
"""


def unit_text(
    settings: ServiceSettings, python: str, systemd: int | None, serial_group: str, has_clients: bool = False
) -> str:
    """`systemd`: its release, None where nobody knows. `serial_group` may open serial ports. `has_clients`: they come
    over a network.
    """
    is_guard = settings.run == "guard"
    unit = _UNIT.format(
        what="guard of a vehicle" if is_guard else "a mission",
        command=" ".join(map(_word, (python, "-P", "-m", "rebound_cli", *settings.arguments()))),
        restarting=_restarting(is_guard, systemd),
        user=USER,
        state=STATE_FOLDER,
        link=_link(settings.device, serial_group, has_clients),
        install="\n[Install]\nWantedBy=multi-user.target" if is_guard else "",
    )
    return unit.rstrip() + "\n"


def _restarting(is_guard: bool, systemd: int | None) -> str:
    if not is_guard:
        return "# A mission arms the vehicle: each flight is started by a person, never by a restart.\nRestart=no"
    # 1 s in the air, where it counts; after five failures in a row the time for which a vehicle is waited for.
    has_back_off = systemd is not None and systemd >= _BACK_OFF_SINCE
    back_off = "RestartSteps=5\nRestartMaxDelaySec=10\n" if has_back_off else ""
    return f"""Restart=on-failure
RestartSec=1
{back_off}# The command line or the configuration is wrong: the next start would end the same way.
RestartPreventExitStatus={" ".join(map(str, exit_codes.PERMANENT))}"""


def _link(device: str | None, serial_group: str, has_clients: bool) -> str:
    """The way out to the vehicle, a device or a network; the other one is open to nobody but the guard's clients."""
    network = "RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6"
    if device is None:
        return f"PrivateDevices=yes\n{network}"
    name = Path(device).name
    if device.startswith(_BY_ID):
        # udev ends the names of converters, which are ttyUSB, with the number of their port (60-serial.rules).
        name = "ttyUSB" if re.search(r"-port\d+$", name) else "ttyACM"
    major = _USB_MAJORS.get(name[:6])
    # systemd allows a device by its number of this moment: one that comes later would stay closed to whoever waits.
    present = f"ExecStartPre=/usr/bin/test -c {device}\n" if major is None else ""
    return f"""# The link: {device}
{present}DevicePolicy=closed
DeviceAllow={device if major is None else f"char-{major}"} rw
SupplementaryGroups={serial_group}
{network if has_clients else _NO_NETWORK}"""


def _word(text: str) -> str:
    """As a word of a unit's command line, where %, $ and white space mean something."""
    text = text.replace("%", "%%").replace("$", "$$")
    if re.fullmatch(r"[\w%$@+=:,./\[\]-]+", text, re.ASCII):
        return text
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
