"""The guard as a service of a real systemd: installed, booted, hit, killed, hung, configured wrongly.

systemd is process 1 of a sandbox: this machine's files, with changes, processes and cgroups of its own.
"""

import contextlib
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import time
from pathlib import Path

import pytest

from tests.clients.simulator import simulator
from tests.rebound_cli.command import taken_off
from tests.rebound_cli.live.cable import Cable

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


# What the unit hides from the service, such as /tmp and /home, can hold neither the checkout nor its environment.
WHY_NOT = "`make sandbox` boots a systemd, as root, in namespaces of its own; nobody gets that unasked"
pytestmark = [pytest.mark.realtime, pytest.mark.skipif(not os.environ.get("REBOUND_SANDBOX"), reason=WHY_NOT)]


def events(sandbox):
    runs = sorted(sandbox.file("/var/lib/rebound/runs").iterdir())
    return [json.loads(line)["kind"] for line in (runs[-1] / "events.jsonl").read_text().splitlines()]


def is_in(sandbox, state):
    return sandbox.shown("SubState") == "running" and sandbox.shown("StatusText").startswith(f"state {state}")


def test_installed_booted_hit_killed_hung_and_configured_wrongly(rebound_vehicle, tmp_path):
    with Sandbox(tmp_path / "sandbox") as sandbox:
        # Given a guard that was installed, and a computer that boots
        sandbox.boot()
        sandbox.install_rebound()
        guard = ("--guard", ROOT / "examples" / "guard.yaml")
        done = sandbox.rebound("service", "install", *guard, "--connect", rebound_vehicle.tcp_address)
        assert done.returncode == 0, done.stderr
        checked = sandbox.rebound("service", "check")
        assert checked.returncode == 0, checked.stdout
        sandbox.boot()
        sandbox.wait_for(lambda: is_in(sandbox, "standing by"))
        policy = sandbox.run("chrt", "--all-tasks", "--pid", sandbox.shown("MainPID")).stdout
        # A kernel may refuse it, as in a container: then that is told.
        first, threads = policy.count("SCHED_FIFO"), policy.count("policy")
        assert threads > 0 and (first == threads or "lost" in events(sandbox)), policy
        assert "MemoryDenyWriteExecute=yes" in sandbox.file("/etc/systemd/system/rebound.service").read_text()
        # When a pilot flies
        pilot = taken_off(rebound_vehicle)
        sandbox.wait_for(lambda: is_in(sandbox, "watching"))
        assert json.loads(sandbox.rebound("status", "--json").stdout)["state"] == "watching"
        # Then a hit is recovered from
        rebound_vehicle.hit(1.5, bearing_deg=90)
        sandbox.wait_for(lambda: "given_back" in events(sandbox))
        # And one that was killed, or hangs, is there again, takes nothing over by itself, and recovers from the next
        for signal, restarts in (("KILL", "1"), ("STOP", "2")):
            assert sandbox.run("systemctl", "kill", "-s", signal, "rebound").returncode == 0
            sandbox.wait_for(lambda restarts=restarts: sandbox.shown("NRestarts") == restarts)
            sandbox.wait_for(lambda: is_in(sandbox, "watching"))
            assert "take_over" not in events(sandbox)
            rebound_vehicle.hit(1.5, bearing_deg=90)
            sandbox.wait_for(lambda: "given_back" in events(sandbox))
        pilot.close()
        # A configuration that is wrong is no reason to start again
        sandbox.file("/etc/rebound/guard.yaml").write_text("max_hits: none\n")
        sandbox.run("systemctl", "restart", "--no-block", "rebound")
        sandbox.wait_for(lambda: sandbox.shown("ExecMainStatus") == "78")
        assert sandbox.shown("ActiveState") == "failed" and sandbox.shown("NRestarts") == "0"


def test_ready_at_the_first_heartbeat_on_the_one_device_that_it_may_open(tmp_path):
    with Cable(tmp_path / "pixhawk") as cable, Sandbox(tmp_path / "sandbox") as sandbox:
        ours = cable.plug()
        shutil.chown(ours, "root", "dialout")
        os.chmod(ours, 0o660)
        # Given a computer that is up before the vehicle is
        sandbox.boot()
        sandbox.install_rebound()
        guard = ("--guard", ROOT / "examples" / "guard.yaml")
        done = sandbox.rebound("service", "install", *guard, "--connect", f"serial://{ours}:921600")
        assert done.returncode == 0, done.stderr
        sandbox.wait_for(lambda: "none heard yet" in sandbox.shown("StatusText"))
        assert sandbox.shown("ActiveState") == "activating"
        # When the vehicle starts
        with simulator("--link", cable.vehicle_url):
            # Then the service is ready, and sees it over that device alone: no network, no other
            sandbox.wait_for(lambda: is_in(sandbox, "standing by"))
        assert sandbox.shown("PrivateNetwork") == "yes"
        # Its clock is ProtectClock's, to be read.
        assert sandbox.shown("DeviceAllow").splitlines() == ["char-rtc r", f"{ours} rw"]
        assert sandbox.shown("NRestarts") == "0"
        # And a vehicle that has gone is waited for
        sandbox.wait_for(lambda: "link silent for" in sandbox.shown("StatusText"))
        assert sandbox.shown("SubState") == "running"
