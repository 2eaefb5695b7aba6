"""Kernels are compiled before a flight waits for them, and somebody who waits sees how far it is."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rebound_cli.live.console import Console

if TYPE_CHECKING:
    from rebound_cli.inputs import SimulatedWorld

_ROOM = "sim_vehicle."
COMPILED = "Compiled code"


def prepare_vehicle(console: Console, world: "SimulatedWorld") -> None:
    """All that a vehicle calls, it calls in its first interval."""
    from sim_vehicle.physics.jit import NOT_KEPT
    from sim_vehicle.vehicle import SimulatedVehicle

    what = "Compiling the simulated vehicle's physics"
    with compiling_shown(console, f"{what}, once for this machine" if NOT_KEPT is None else what):
        SimulatedVehicle(world.airframe, world.scene, world.seed, keeps_path=False)
    if NOT_KEPT is not None:
        console.print(f"{COMPILED} is not kept ({NOT_KEPT}): give NUMBA_CACHE_DIR a folder that can be written to.")


@contextmanager
def compiling_shown(console: Console, what: str) -> Iterator[None]:
    """Show how much is compiled meanwhile, from the first kernel on that has to be."""
    try:
        from numba.core import event
    except ImportError:
        # Without numba nothing is compiled.
        yield
        return
    kernels: list[Any] = []

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, event: Any) -> None:
            dispatcher = event.data["dispatcher"]
            # Numba compiles functions of its own beside ours.
            if dispatcher.py_func.__module__.startswith(_ROOM):
                kernels[:] = kernels or _kernels_beside(dispatcher)
                # They are compiled, or were kept by an earlier start.
                console.progress(what, sum(bool(kernel.overloads) for kernel in kernels), len(kernels))

        on_end = on_start

    with event.install_listener("numba:compile", Listener()):
        yield
    if kernels:
        console.progress(what, len(kernels), len(kernels))


def _kernels_beside(dispatcher: Any) -> list[Any]:
    """With all of the simulated vehicle, as far as it is loaded."""
    modules = [module for name, module in sys.modules.items() if name.startswith(_ROOM)]
    values = [dispatcher, *(value for module in modules for value in vars(module).values())]
    return list({id(value): value for value in values if type(value) is type(dispatcher)}.values())
