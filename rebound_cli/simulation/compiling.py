"""Kernels are compiled before a flight waits for them, and somebody who waits is told why."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rebound_cli.live.console import Console

if TYPE_CHECKING:
    from rebound_cli.inputs import SimulatedWorld

_ROOM = "sim_vehicle."
# How what a person is told of it begins.
COMPILING, COMPILED = "Compiling", "Compiled code"


def prepare_vehicle(console: Console, world: "SimulatedWorld") -> None:
    """All that a vehicle calls, it calls in its first interval."""
    from sim_vehicle.physics.jit import NOT_KEPT
    from sim_vehicle.vehicle import SimulatedVehicle

    what = f"{COMPILING} the simulated vehicle's physics, which takes half a minute"
    with compiling_told(console, f"{what}, once for this machine" if NOT_KEPT is None else what):
        SimulatedVehicle(world.airframe, world.scene, world.seed, keeps_path=False)
    if NOT_KEPT is not None:
        console.print(f"{COMPILED} is not kept ({NOT_KEPT}): give NUMBA_CACHE_DIR a folder that can be written to.")


@contextmanager
def compiling_told(console: Console, text: str) -> Iterator[None]:
    """With the first of our kernels that has to be compiled meanwhile."""
    try:
        from numba.core import event
    except ImportError:
        # Without numba nothing is compiled.
        yield
        return

    class Listener(event.Listener):  # type: ignore[misc]
        is_told = False

        def on_start(self, event: Any) -> None:
            # Numba compiles functions of its own beside ours.
            if not self.is_told and event.data["dispatcher"].py_func.__module__.startswith(_ROOM):
                self.is_told = True
                console.print(text)

        def on_end(self, event: Any) -> None:
            """Nothing: what follows shows that it is over."""

    with event.install_listener("numba:compile", Listener()):
        yield
