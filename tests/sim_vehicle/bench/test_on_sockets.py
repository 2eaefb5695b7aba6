"""A vehicle under test on real sockets, and as a fixture of other people's suites, each run by a pytest of its own."""

import re
import socket
import threading
import time
import tomllib
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import numba
import pytest

from sim_vehicle.errors import ConditionNotMet, SceneError, SimulationError, VehicleEnded
from sim_vehicle.physics import jit
from sim_vehicle.shell.truth_file import load_truth
from sim_vehicle.testing import RunningVehicle, Truth, Wall, faults, start_vehicle
from sim_vehicle.truth import Hit
from tests.sim_vehicle.vehicle_client import End, heard_until

TIMEOUT_S = 10.0
HERE = "127.0.0.1"


def connected(vehicle: RunningVehicle) -> socket.socket:
    client = socket.create_connection((HERE, vehicle.tcp_port), TIMEOUT_S)
    client.settimeout(TIMEOUT_S)
    return client


def vehicle_threads() -> int:
    return sum(thread.name.startswith("simulated vehicle") for thread in threading.enumerate())


def test_it_is_there_at_its_addresses_and_gone_afterwards() -> None:
    with start_vehicle() as vehicle, connected(vehicle) as client:
        assert vehicle.address == f"udpout://{HERE}:{vehicle.udp_port}"
        assert vehicle.mavutil_address == f"tcp:{HERE}:{vehicle.tcp_port}"
        heard_until(client, {"HEARTBEAT", "HIGHRES_IMU"})
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second:
            second.settimeout(TIMEOUT_S)
            End(lambda raw: second.sendto(raw, (HERE, vehicle.udp_port))).command(512, 148)
            heard_until(second, {"AUTOPILOT_VERSION", "HEARTBEAT"})
    assert vehicle_threads() == 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind((HERE, vehicle.udp_port))
    with pytest.raises(VehicleEnded, match="has been stopped"):
        vehicle.hit(1.0)
    # What happened may be read afterwards, too
    assert vehicle.truth.time_boot_s > 0


def test_a_setup_that_cannot_be_leaves_nothing_behind() -> None:
    with pytest.raises(SceneError):
        start_vehicle(obstacles=[Wall(point_ned_m=(0.1, 0, 0), normal_ned=(-1, 0, 0))])
    with pytest.raises(SimulationError, match="is not an address"):
        start_vehicle(links=("nonsense",))
    with pytest.raises(SimulationError, match="a speed is 0 or from"):
        start_vehicle(speed=-1.0)
    assert vehicle_threads() == 0


def test_walls_strikes_faults_and_truth_while_it_flies() -> None:
    with start_vehicle(speed=20.0, seed=3) as vehicle, connected(vehicle) as client:
        pilot = End(client.sendall)
        pilot.command(400, 1)
        pilot.command(22)
        vehicle.wait_until(lambda truth: truth.mode == "Hold" and truth.height_m > 2.2, within_s=30)
        wall = vehicle.place(Wall(point_ned_m=(2, 0, -2), normal_ned=(-1, 0, 0), name="gate"))
        with pytest.raises(SceneError, match="would pass through the vehicle"):
            vehicle.place(Wall(point_ned_m=(0.1, 0, -2.5), normal_ned=(-1, 0, 0)))
        name = vehicle.hit(1.5, bearing_deg=90.0)
        truth = vehicle.wait_until(lambda truth: truth.hits, within_s=2)
        assert truth.hits[0].obstacle == name and truth.hits[0].normal_ned[1] < -0.99
        wall.remove()
        with vehicle.inject(faults.motor_failure(0)):
            vehicle.wait_until(lambda truth: truth.height_m < 0.5, within_s=10)
    texts = [event.text for event in vehicle.timeline]
    assert "placed 'gate'" in texts and "removed 'gate'" in texts
    assert any(text.startswith("fault motor_failure") for text in texts)


def test_a_pause_stands_still_and_goes_on_where_it_stood() -> None:
    with start_vehicle() as vehicle, connected(vehicle) as client:
        heard_until(client, {"HEARTBEAT"})
        vehicle.pause()
        paused_s = vehicle.truth.time_boot_s
        with pytest.raises(SimulationError, match="stands still"):
            vehicle.wait_until(lambda truth: True, 1.0)
        # Short enough to be caught up, had it been lateness
        time.sleep(0.4)
        assert vehicle.is_paused and vehicle.truth.time_boot_s == paused_s
        vehicle.inject(faults.clock_jump(5.0))
        resumed_s = time.monotonic()
        vehicle.resume()
        vehicle.wait_until(lambda truth: truth.time_boot_s > paused_s + 0.2, within_s=1)
        assert time.monotonic() - resumed_s > 0.19


def test_its_speed_can_be_changed() -> None:
    with start_vehicle(speed=1.0) as vehicle, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        assert took_s(lambda: passes(vehicle, 0.2)) > 0.19
        vehicle.speed = 0
        End(lambda raw: client.sendto(raw, (HERE, vehicle.udp_port))).heartbeat()
        assert took_s(lambda: passes(vehicle, 35.0)) < 25.0
        assert len(vehicle._bench.vehicle._links) == 1
        vehicle.speed = 2.0
        assert vehicle.speed == 2.0
        assert 0.98 < took_s(lambda: passes(vehicle, 2.0)) < 1.9
        with pytest.raises(SimulationError, match="and not -3"):
            vehicle.speed = -3


def test_time_outs_are_stretched_with_the_speed_unless_stated() -> None:
    with start_vehicle(speed=5.0, parameters={"COM_OF_LOSS_T": 0.5}) as vehicle:
        parameters = vehicle.setup.parameters
        assert parameters == {"COM_DL_LOSS_T": 50.0, "COM_RC_LOSS_T": 5.0, "COM_OF_LOSS_T": 0.5}
    with start_vehicle() as vehicle:
        assert vehicle.setup.parameters == {}


def passes(vehicle: RunningVehicle, seconds: float) -> None:
    until_s = vehicle.truth.time_boot_s + seconds
    vehicle.wait_until(lambda truth: truth.time_boot_s >= until_s, within_s=seconds + 1)


def took_s(what: Callable[[], None]) -> float:
    begun_s = time.monotonic()
    what()
    return time.monotonic() - begun_s


def test_a_condition_may_ask_and_change_the_vehicle_but_not_wait_for_it_in_vain_or_break() -> None:
    with start_vehicle(speed=0.0, seed=11) as vehicle:
        with pytest.raises(ConditionNotMet, match=r"within 0.5 s \(seed 11\)"):
            vehicle.wait_until(lambda truth: truth.hits, within_s=0.5)
        with pytest.raises(ZeroDivisionError):
            vehicle.wait_until(lambda truth: 1 / 0, within_s=0.5)
        passes(vehicle, 0.1)
        swung: list[str] = []

        def struck(truth: Truth) -> bool:
            if not swung:
                swung.append(vehicle.hit(1.0))
            return bool(vehicle.truth.hits)

        assert vehicle.wait_until(struck, within_s=2.0).hits[0].obstacle == swung[0]
        with pytest.raises(SimulationError, match="stands still"):
            vehicle.wait_until(lambda truth: vehicle.wait_until(lambda truth: True, 1.0), 1.0)


def test_whoever_waits_when_it_is_stopped_is_told() -> None:
    vehicle = start_vehicle()
    threading.Timer(0.2, vehicle.stop).start()
    with pytest.raises(VehicleEnded):
        vehicle.wait_until(lambda truth: truth.hits, within_s=60)
    vehicle.stop()


def test_a_vehicle_that_comes_to_grief_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    vehicle = start_vehicle()

    def broken() -> None:
        raise RuntimeError("bent")

    monkeypatch.setattr(vehicle._bench, "step", broken)
    with pytest.raises(VehicleEnded, match="came to grief: RuntimeError\\('bent'\\)"):
        while True:
            vehicle.pause()
            vehicle.resume()
    with pytest.raises(VehicleEnded, match="came to grief"):
        vehicle.stop()
    vehicle.stop()
    assert vehicle_threads() == 0


pytest_plugins = "pytester"

ROOT = Path(__file__).parents[3]


@pytest.fixture
def suite(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """Without whatever plugins are installed here, so that it does not matter whether this package is."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    # pytester has taken the user's cache folder, with its compiled kernels, from these programs.
    if jit.NOT_KEPT is None:
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(Path(numba.config.CACHE_DIR).parent))
    return pytester


def run(suite: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    return suite.runpytest_subprocess("-p", "sim_vehicle.shell.pytest_plugin", "-p", "no:cacheprovider", *arguments)


def test_installing_the_package_installs_the_fixture() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    plugin = import_module(project["entry-points"]["pytest11"]["rebound"])
    assert hasattr(plugin, "rebound_vehicle")


def test_marks_parameters_and_the_command_line_say_how_it_begins(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest
        from sim_vehicle.testing import LockstepVehicle, RunningVehicle, Wall

        @pytest.mark.rebound(airframe="rigid", seed=7)
        class TestMarked:
            @pytest.mark.rebound(lockstep=True, obstacles=[Wall(point_ned_m=(3, 0, -1), normal_ned=(-1, 0, 0))])
            def test_lockstep(self, rebound_vehicle):
                assert isinstance(rebound_vehicle, LockstepVehicle)
                setup = rebound_vehicle.setup
                assert (setup.airframe, setup.seed, len(setup.obstacles)) == ("rigid", 7, 1)
                assert rebound_vehicle.advance(0.1)

        def test_sockets(rebound_vehicle):
            assert isinstance(rebound_vehicle, RunningVehicle)
            assert (rebound_vehicle.setup.seed, rebound_vehicle.speed) == (4, 3.0)
            assert rebound_vehicle.address.startswith("udpout://127.0.0.1:")

        @pytest.mark.parametrize("rebound_vehicle", [{"airframe": "rigid"}, {"seed": 2, "speed": 0}], indirect=True)
        def test_parametrized(rebound_vehicle):
            assert (rebound_vehicle.setup.airframe, rebound_vehicle.setup.seed, rebound_vehicle.speed) in (
                ("rigid", 4, 3.0), ("foldable", 2, 0),
            )
        """
    )
    run(suite, "--rebound-seed=4", "--rebound-speed=3", "--strict-markers").assert_outcomes(passed=4)


def test_a_failed_test_says_what_happened_and_where_the_truth_is(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest

        @pytest.mark.rebound(lockstep=True, seed=5)
        def test_fails(rebound_vehicle):
            rebound_vehicle.advance(0.5)
            rebound_vehicle.hit(1.0)
            rebound_vehicle.advance(1.0)
            assert not rebound_vehicle.truth.hits

        def test_fails_on_sockets(rebound_vehicle):
            raise AssertionError

        def test_passes(rebound_vehicle):
            pass
        """
    )
    result = run(suite)
    result.assert_outcomes(passed=1, failed=2)
    result.stdout.fnmatch_lines(
        [
            "*rebound vehicle*",
            "seed 5 (again: --rebound-seed 5), airframe 'foldable'",
            "at 1.5*Hold, disarmed*1 hits",
            "*0.504 s  strike 1 swung*",
            "*hits 'strike 1' at 1.0* m/s*",
            "truth: */truth.npz",
        ]
    )
    output = result.stdout.str()
    assert output.count("rebound vehicle ---") == 2
    paths = re.findall(r"truth: (\S+)", output)
    hits: list[Hit] = load_truth(Path(paths[0]))[0]
    assert [hit.obstacle for hit in hits] == ["strike 1"] and len(set(paths)) == 2


def test_who_does_not_use_it_does_not_load_it(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import sys

        def test_light():
            loaded = {name.split(".")[0] for name in sys.modules}
            assert not loaded & {"numpy", "numba", "pymavlink", "scipy", "pydantic"}
            assert [name for name in sys.modules if name.startswith("sim_vehicle")] == [
                "sim_vehicle", "sim_vehicle.shell", "sim_vehicle.shell.pytest_plugin",
            ]
        """
    )
    run(suite).assert_outcomes(passed=1)


def test_a_wrong_mark_is_an_error_that_says_what_to_do(suite: pytest.Pytester) -> None:
    suite.makepyfile(
        """
        import pytest

        @pytest.mark.rebound("rigid")
        def test_it(rebound_vehicle):
            pass

        @pytest.mark.rebound(lockstep=True, airfram="rigid")
        def test_that(rebound_vehicle):
            pass
        """
    )
    result = run(suite)
    result.assert_outcomes(errors=2)
    result.stdout.fnmatch_lines(["*the mark rebound takes settings by name*"])
    result.stdout.fnmatch_lines(["*the mark rebound has no setting 'airfram': did you mean airframe?*"])


@pytest.mark.slow
def test_every_example_for_test_authors_passes(suite: pytest.Pytester) -> None:
    texts = [(ROOT / "docs" / page).read_text() for page in ("how-to/testing.md", "tutorials/test-your-program.md")]
    tests, scripts = [], []
    for example in re.findall(r"^```python\n(.*?)^```$", "\n".join(texts), re.DOTALL | re.MULTILINE):
        (tests if "def test_" in example else scripts).append(example)
    assert (len(tests), len(scripts)) == (6, 1)
    assert suite.runpython(suite.makepyfile(script=scripts[0])).ret == 0
    suite.makepyfile(**{f"test_example_{number}": example for number, example in enumerate(tests)})
    run(suite, "--strict-markers").assert_outcomes(passed=len(tests))
