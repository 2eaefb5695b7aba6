"""A real systemd as process 1 of a sandbox: this machine's files, with changes, processes and cgroups of its own."""

import contextlib
import os
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

ROOT = Path(__file__).parents[3]
PYTHON = "/opt/rebound/bin/python"
_SYSTEMD = "/lib/systemd/systemd"
# What a container does without.
_MASKED = (
    *(
        "systemd-tmpfiles-setup",
        "systemd-tmpfiles-setup-dev",
        "systemd-remount-fs",
        "systemd-logind",
        "systemd-pcrphase",
    ),
    *("systemd-update-utmp", "systemd-network-generator", "console-getty", "getty@tty1"),
)
# A drone has neither: the unit forbids memory that is written and executed then.
_LEFT_OUT = ("numba", "llvmlite")

# "$1": the folder of changes. Process 1 comes to a root that is an overlay, and to a cgroup that is its whole tree.
_BOOT = """
set -e
R=$1/root
mount -t overlay overlay -o lowerdir=/,upperdir=$1/up,workdir=$1/work $R
mount -t proc proc $R/proc
# The kernel's settings are this machine's.
mount --bind $R/proc/sys $R/proc/sys
mount -o remount,ro,bind $R/proc/sys
mount -t sysfs sysfs $R/sys
mount -t tmpfs tmpfs $R/run -o mode=755
mount -t tmpfs tmpfs $R/dev -o mode=755
for node in null zero full random urandom tty; do touch $R/dev/$node; mount --bind /dev/$node $R/dev/$node; done
mkdir -p $R/dev/pts $R/dev/shm $R/sys/fs/cgroup
mount --rbind /dev/pts $R/dev/pts
ln -s pts/ptmx $R/dev/ptmx
mount -t tmpfs tmpfs $R/dev/shm
mount -t cgroup2 cgroup2 $1/cgroup
mkdir -p $1/cgroup/$2
echo 0 > $1/cgroup/$2/cgroup.procs
exec unshare --cgroup sh -ec '
mount -t cgroup2 cgroup2 $0/sys/fs/cgroup
cd $0
mkdir -p before
pivot_root . before
umount -l /before
exec env -i container=rebound PATH=/usr/sbin:/usr/bin:/sbin:/bin """
_BOOT += f"""{_SYSTEMD} --system --log-target=journal --show-status=no' $R"""


class Sandbox:
    """Runs from `boot` until the end of its `with`; a second `boot` keeps its changes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._process: subprocess.Popen | None = None
        for name in ("up/etc/systemd/system", "work", "root", "cgroup"):
            (folder / name).mkdir(parents=True)
        for unit in _MASKED:
            (folder / "up/etc/systemd/system" / f"{unit}.service").symlink_to("/dev/null")
        # Not the services of this machine.
        wanted = folder / "up/etc/systemd/system/multi-user.target.wants"
        wanted.mkdir()
        os.setxattr(wanted, "trusted.overlay.opaque", b"y")
        self._group = f"rebound-{os.getpid()}"

    def file(self, path: str) -> Path:
        """One that has been changed inside."""
        return self.folder / "up" / path.removeprefix("/")

    def boot(self) -> None:
        self.end()
        namespaces = ["--mount", "--pid", "--uts", "--ipc", "--propagation", "private"]
        command = ["unshare", *namespaces, "--fork", "--kill-child=KILL", "sh", "-c", _BOOT, "boot"]
        self._process = subprocess.Popen([*command, str(self.folder), self._group], stdin=subprocess.DEVNULL)
        self.wait_for(lambda: self._first() is not None)
        self.wait_for(lambda: self.run("systemctl", "is-system-running").stdout.strip() in ("running", "degraded"))

    def run(self, *command: str) -> subprocess.CompletedProcess:
        inside = ["nsenter", "-t", str(self._first()), "-m", "-p", "-u", "-i", "-C", "--wd=/", *map(str, command)]
        return subprocess.run(inside, capture_output=True, text=True, check=False, timeout=60)

    def _first(self) -> str | None:
        """Process 1 by its number outside; None before it is systemd."""
        pid = self._process.pid
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return next((child for child in children if Path(f"/proc/{child}/comm").read_text() == "systemd\n"), None)

    def install_rebound(self) -> None:
        """What a drone has of this checkout, in /opt."""
        assert self.run("/usr/bin/python3", "-m", "venv", "--without-pip", "/opt/rebound").returncode == 0
        major, minor = sys.version_info[:2]
        site = self.file(f"/opt/rebound/lib/python{major}.{minor}/site-packages")
        (site / "rebound.pth").write_text(f"{ROOT}\n")
        for package in Path(sysconfig.get_path("purelib")).iterdir():
            if package.suffix != ".pth" and not package.name.startswith((*_LEFT_OUT, "__editable__")):
                (site / package.name).symlink_to(package)

    def rebound(self, *words: str) -> subprocess.CompletedProcess:
        return self.run(PYTHON, "-P", "-m", "rebound_cli", *words)

    def shown(self, name: str) -> str:
        """What systemd knows of the service."""
        return self.run("systemctl", "show", "-P", name, "rebound.service").stdout.strip()

    def wait_for(self, condition, within_s: float = 40.0) -> None:
        end_s = time.monotonic() + within_s
        while not condition():
            assert time.monotonic() < end_s, (
                self._first() and self.run("journalctl", "-b", "-n", "40", "--no-pager").stdout
            )
            time.sleep(0.2)

    def end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
        mounted = [line.split()[1] for line in Path("/proc/mounts").read_text().splitlines() if " cgroup2 " in line]
        for group in (Path(place, self._group) for place in mounted):
            for inner in sorted(group.rglob("*/"), reverse=True):
                if inner.is_dir():
                    self._removed(inner)
            if group.is_dir():
                self._removed(group)

    def _removed(self, group: Path) -> None:
        # A process that was killed just now is still in it for a moment.
        for _ in range(50):
            with contextlib.suppress(OSError):
                group.rmdir()
                return
            time.sleep(0.1)

    def __enter__(self):
        return self

    def __exit__(self, *_) -> None:
        self.end()
