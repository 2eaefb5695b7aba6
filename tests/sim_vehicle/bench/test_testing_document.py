"""The examples for test authors, run as a reader would run them."""

import re
from pathlib import Path

import pytest

from tests.sim_vehicle.bench.kept_kernels import keep_kernels

pytestmark = pytest.mark.slow

pytest_plugins = "pytester"

ROOT = Path(__file__).parents[3]
PAGES = ("how-to/testing.md", "tutorials/test-your-program.md")


def examples() -> list[str]:
    texts = [(ROOT / "docs" / page).read_text() for page in PAGES]
    return [one for text in texts for one in re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)]


def test_every_example_passes(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    keep_kernels(monkeypatch)
    tests, scripts = [], []
    for number, example in enumerate(examples()):
        (tests if "def test_" in example else scripts).append(example)
        pytester.makepyfile(**{f"test_example_{number}" if "def test_" in example else f"script_{number}": example})
    assert (len(tests), len(scripts)) == (6, 1)
    for path in sorted(pytester.path.glob("script_*.py")):
        assert pytester.runpython(path).ret == 0
    result = pytester.runpytest_subprocess(
        "-p", "sim_vehicle.shell.pytest_plugin", "-p", "no:cacheprovider", "--strict-markers"
    )
    result.assert_outcomes(passed=len(tests))
