"""The pytest plugin in other people's test suites, each run by a pytest of its own."""

import re
import tomllib
from importlib import import_module
from pathlib import Path

import numba
import pytest

from sim_vehicle.physics import jit
from sim_vehicle.truth import Hit

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
    from sim_vehicle.shell.truth_file import load_truth

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
