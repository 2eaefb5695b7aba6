"""Compiled kernels for programs that a test runs with a home folder of its own."""

from pathlib import Path

import numba
import pytest

from sim_vehicle.physics import jit


def keep_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give a test's programs this one's compiled kernels: pytester has taken the user's cache folder from them."""
    if jit.NOT_KEPT is None:
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(Path(numba.config.CACHE_DIR).parent))
