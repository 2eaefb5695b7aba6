"""The system that the service is installed on: its folder, its programs, its user."""

import grp
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import rebound_cli
from companion.errors import ReboundError
from companion.shell.files import write_whole

# ProtectHome= hides these from the service.
_HIDDEN = ("/home", "/root", "/run/user")
# Who may open serial ports: Debian's and Ubuntu's group, and Arch's.
_SERIAL_GROUPS = ("dialout", "uucp")


@dataclass(frozen=True, slots=True)
class System:
    """The one of this computer; with another `root` its files in a folder."""

    root: Path = Path("/")

    @property
    def is_running(self) -> bool:
        """Not where an image is made, in a chroot or a container: there all begins with the first boot."""
        # As sd_booted(3) finds out.
        return self.root == Path("/") and Path("/run/systemd/system").is_dir()

    def refuse_if_unfit(self) -> None:
        """Raises ReboundError where there is no systemd, or nothing may be changed."""
        if shutil.which("systemctl") is None:
            raise ReboundError("This system has no systemd, which runs Rebound's service.")
        if not os.access(self.root / "etc", os.W_OK):
            raise ReboundError(f"{self.root / 'etc'} cannot be written to: run it again with sudo.")

    def call(self, *command: str) -> int:
        """The exit code; what the program prints is for the person. Raises ReboundError where it is not there."""
        if shutil.which(command[0]) is None:
            raise ReboundError(f"{command[0]} is not on this machine: Rebound's service needs systemd.")
        return subprocess.run(command, check=False).returncode

    def told(self, *command: str) -> None:
        """Raises ReboundError where it fails."""
        code = self.call(*command)
        if code != 0:
            raise ReboundError(f"`{' '.join(command)}` failed with exit code {code}: what it says is above.")

    def release(self) -> int | None:
        """systemd's; None where there is none."""
        if shutil.which("systemctl") is None:
            return None
        found = re.match(r"systemd (\d+)", answer("systemctl", "--version"))
        return None if found is None else int(found[1])

    def write(self, path: str, text: str) -> None:
        """Whenever this ends, the file is whole: the old one or the new one."""
        file = self.root / path
        # The service's user reads it, whatever the umask of whoever installs.
        if not file.parent.is_dir():
            file.parent.mkdir(parents=True)
            file.parent.chmod(0o755)
        write_whole(file, text.encode())
        file.chmod(0o644)


def answer(*command: str) -> str:
    """What the program prints."""
    done = subprocess.run(command, check=False, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return done.stdout.strip()


def serial_group() -> str:
    present = {group.gr_name for group in grp.getgrall()}
    return next((name for name in _SERIAL_GROUPS if name in present), _SERIAL_GROUPS[0])


def hidden_program() -> str | None:
    """The folder with a part of this program that the service could not read."""
    parts = (sys.prefix, sys.base_prefix, str(Path(rebound_cli.__file__).parent))
    return next((part for part in parts if any(Path(part).resolve().is_relative_to(place) for place in _HIDDEN)), None)
