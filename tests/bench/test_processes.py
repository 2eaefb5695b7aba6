"""Flights on several processes of this machine."""

import os
import signal
import subprocess
import sys

from bench.processes import in_processes

WORK = """
import os, signal, time
def wait(seconds):
    if seconds:
        # Every process of the group, as a terminal sends it; this one first, that its end would be heard.
        os.kill(os.getpid(), signal.SIGINT)
        os.killpg(0, signal.SIGINT)
        time.sleep(seconds)
"""


def test_results_come_in_the_order_of_the_items():
    assert in_processes(abs, [-3, -2, -1], 2) == [3, 2, 1]


def test_ctrl_c_ends_everything_and_only_the_first_process_hears_it(tmp_path):
    (tmp_path / "waiting.py").write_text(WORK)
    # A shell lets what it runs in the background ignore Ctrl-C, these tests too; this program is not to inherit that.
    program = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    program += "import waiting\nfrom bench.processes import in_processes\n"
    program += "if __name__ == '__main__':\n    in_processes(waiting.wait, [0, 60, 60, 60], 2)\n"
    (tmp_path / "program.py").write_text(program)
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    ended = subprocess.run(
        [sys.executable, str(tmp_path / "program.py")],
        env=os.environ | {"PYTHONPATH": path},
        start_new_session=True,
        capture_output=True,
        text=True,
        timeout=50,
    )
    assert ended.returncode == -signal.SIGINT
    assert ended.stderr.rstrip().endswith("KeyboardInterrupt") and "PoolWorker" not in ended.stderr
