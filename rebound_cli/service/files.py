"""The files of the service that follow from its settings: the unit, udev's rules, the user."""

import re
from importlib.util import find_spec
from pathlib import Path

from rebound_cli import exit_codes
from rebound_cli.flights.kept import SERVICE_RUNS
from rebound_cli.service.settings import ServiceSettings

UNIT_NAME = "rebound.service"
UNIT = f"etc/systemd/system/{UNIT_NAME}"
UDEV = "etc/udev/rules.d/90-rebound.rules"
SYSUSERS = "etc/sysusers.d/rebound.conf"
USER = "rebound"
STATE_FOLDER = SERVICE_RUNS.parent

# The release of systemd that brought RestartSteps and RestartMaxDelaySec; older ones complain of them.
BACK_OFF_SINCE = 254
# MAVLink's heartbeat protocol gives a component up after five beats of one second: others take it for gone by then.
# PX4 has had control back for four of them (COM_OF_LOSS_T, 1 s), and no busy card is taken for a loop that hangs.
WATCHDOG_S = 5
# Handing the vehicle over takes 10 s at most (realtime.HANDING_OVER_US); as long again for a slow card to take the log.
STOP_S = 20
# Linux's numbers of USB serial ports (devices.txt). A port that is plugged in again may have another name.
_USB_MAJORS = {"ttyACM": 166, "ttyUSB": 188}
_BY_ID = "/dev/serial/by-id/"
_WRITTEN_BY = "# Written by `rebound service install`, from /etc/rebound/service.yaml."


def sysusers_text() -> str:
    return f'{_WRITTEN_BY}\nu {USER} - "Rebound" {STATE_FOLDER}\n'


def udev_text(device: str) -> str:
    """For one port: no modem is looked for on it, and an FTDI chip passes on each byte within 1 ms, not 16."""
    name = device.removeprefix("/dev/")
    port = f'KERNEL=="{name}"' if name.startswith("tty") else f'SYMLINK=="{name}"'
    rule = f'ACTION!="remove", SUBSYSTEM=="tty", {port}'
    return f"""{_WRITTEN_BY}
{rule}, ENV{{ID_MM_PORT_IGNORE}}="1"
{rule}, DRIVERS=="ftdi_sio", ATTR{{device/latency_timer}}="1"
"""


def unit_text(settings: ServiceSettings, python: str, systemd: int | None, serial_group: str) -> str:
    """`systemd`: its release, None where nobody knows. `serial_group` may open serial ports."""
    is_guard = settings.run == "guard"
    command = " ".join(map(_word, (python, "-P", "-m", "rebound_cli", *settings.arguments())))
    parts = [
        _WRITTEN_BY,
        "",
        "[Unit]",
        f"Description=Rebound: {'guard of a vehicle' if is_guard else 'a mission'}",
        "After=network.target",
        "# The back-off bounds how often it is started; it is never given up.",
        "StartLimitIntervalSec=0",
        "",
        "[Service]",
        "# Ready at the vehicle's first heartbeat, however late that comes.",
        "Type=notify",
        "TimeoutStartSec=infinity",
        f"ExecStart={command}",
        *_restarting(is_guard, systemd),
        "# Fed by the loop that decides.",
        f"WatchdogSec={WATCHDOG_S}",
        f"TimeoutStopSec={STOP_S}",
        "",
        f"User={USER}",
        f"WorkingDirectory={STATE_FOLDER}",
        "StateDirectory=rebound",
        "CacheDirectory=rebound",
        "RuntimeDirectory=rebound",
        "Environment=NUMBA_CACHE_DIR=/var/cache/rebound",
        "UMask=0027",
        "# Half of the computer's memory is the system's, whatever happens here.",
        "MemoryMax=50%",
        "TasksMax=64",
        "LimitCORE=0",
        "",
        *_link(settings.device, serial_group),
        "",
        *_HARDENED,
        # Machine code is made here by numba alone (the extras [fit] and [sim]).
        *(["MemoryDenyWriteExecute=yes"] if find_spec("numba") is None else []),
    ]
    if is_guard:
        parts += ["", "[Install]", "WantedBy=multi-user.target"]
    return "\n".join(parts) + "\n"


_HARDENED = (
    "NoNewPrivileges=yes",
    "CapabilityBoundingSet=",
    "ProtectSystem=strict",
    "ProtectHome=yes",
    "ProtectClock=yes",
    "ProtectControlGroups=yes",
    "ProtectHostname=yes",
    "ProtectKernelLogs=yes",
    "ProtectKernelModules=yes",
    "ProtectKernelTunables=yes",
    "ProtectProc=invisible",
    "PrivateTmp=yes",
    "RemoveIPC=yes",
    "LockPersonality=yes",
    "RestrictNamespaces=yes",
    "RestrictRealtime=yes",
    "RestrictSUIDSGID=yes",
    "SystemCallArchitectures=native",
    "SystemCallFilter=@system-service",
    "SystemCallFilter=~@privileged @resources",
    "SystemCallErrorNumber=EPERM",
)


def _restarting(is_guard: bool, systemd: int | None) -> list[str]:
    if not is_guard:
        return ["# A mission arms the vehicle: each flight is started by a person, never by a restart.", "Restart=no"]
    lines = [
        "Restart=on-failure",
        "RestartSec=1",
        "# The command line or the configuration is wrong: the next start would end the same way.",
        f"RestartPreventExitStatus={' '.join(map(str, exit_codes.PERMANENT))}",
    ]
    if systemd is not None and systemd >= BACK_OFF_SINCE:
        # 1 s in the air, where it counts; after five failures in a row the time for which a vehicle is waited for.
        lines[2:2] = ["RestartSteps=5", "RestartMaxDelaySec=10"]
    return lines


def _link(device: str | None, serial_group: str) -> list[str]:
    """The one way out to the vehicle: a device without a network, or a network without a device."""
    if device is None:
        return ["PrivateDevices=yes", "RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6"]
    return [
        f"# The link: {device}",
        "DevicePolicy=closed",
        f"DeviceAllow={_device_rule(device)} rw",
        f"SupplementaryGroups={serial_group}",
        "PrivateNetwork=yes",
        "IPAddressDeny=any",
        "RestrictAddressFamilies=AF_UNIX",
    ]


def _device_rule(device: str) -> str:
    name = Path(device).name
    if device.startswith(_BY_ID):
        # udev ends the names of converters, which are ttyUSB, with the number of their port (60-serial.rules).
        name = "ttyUSB" if re.search(r"-port\d+$", name) else "ttyACM"
    major = _USB_MAJORS.get(name[:6])
    return device if major is None else f"char-{major}"


def _word(text: str) -> str:
    """As a word of a unit's command line, where %, $ and white space mean something."""
    text = text.replace("%", "%%").replace("$", "$$")
    if re.fullmatch(r"[\w%$@+=:,./\[\]-]+", text, re.ASCII):
        return text
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
