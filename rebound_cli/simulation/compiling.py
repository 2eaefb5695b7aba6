"""Kernels are compiled before a flight waits for them, and somebody who waits is told why."""

import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rebound_cli.extras import needed_text
from rebound_cli.live.console import Console, console_for
from sim_vehicle.airframe import built_in_airframes

if TYPE_CHECKING:
    from rebound_cli.inputs.inputs import SimulatedWorld

# How what a person is told of it begins.
COMPILING, COMPILED = "Compiling", "Compiled code"


def prepare_vehicle(console: Console, world: "SimulatedWorld") -> None:
    """All that a vehicle calls, it calls in its first interval."""
    import numba

    from sim_vehicle.physics.jit import NOT_KEPT
    from sim_vehicle.vehicle import SimulatedVehicle

    # The folder is of this version of the kernels alone: where none is in it, all are compiled now.
    if NOT_KEPT is not None or not any(Path(numba.config.CACHE_DIR).rglob("*.nbc")):
        often = "once for this machine" if NOT_KEPT is None else "at every start"
        console.print(f"{COMPILING} the simulated vehicle's physics, which takes half a minute, {often}")
    if NOT_KEPT is not None:
        console.print(f"{COMPILED} is not kept ({NOT_KEPT}): give NUMBA_CACHE_DIR a folder that can be written to.")
    SimulatedVehicle(world.airframe, world.scene, world.scene.seed, keeps_path=False)


def stand_own(world: "SimulatedWorld") -> None:
    """An airframe of one's own stands on the ground before anything is said of it; those that ship do in the tests.

    Raises AirframeError, SceneError. Without the extra [sim] nothing is simulated.
    """
    if world.scene.airframe in built_in_airframes():
        return
    try:
        # What is printed may be read by a program.
        with contextlib.redirect_stdout(sys.stderr), console_for(False) as console:
            prepare_vehicle(console, world)
    except ModuleNotFoundError as error:
        # What no extra brings is an error of ours.
        needed_text(error)
