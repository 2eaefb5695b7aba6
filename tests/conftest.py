"""One worker compiles the simulated vehicle, which takes half a minute; the others begin with what needs none."""

import gc
from contextlib import suppress
from pathlib import Path

import pytest

with suppress(ImportError):  # the clients' environments have no hypothesis
    from hypothesis import settings

    # On a busy machine an example takes as long as it takes.
    settings.register_profile("rebound", deadline=None)
    settings.load_profile("rebound")

_TESTS = Path(__file__).parent
_COMPILES, _COMPILES_NOTHING = _TESTS / "missions" / "test_confirming.py", _TESTS / "companion"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: (item.path != _COMPILES, _COMPILES_NOTHING not in item.path.parents))


def pytest_collection_finish() -> None:
    # What thousands of tests import is no garbage: looking through it again and again takes a tenth of the time.
    gc.freeze()
