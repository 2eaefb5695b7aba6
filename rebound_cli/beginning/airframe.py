"""`rebound airframe px4`: PX4's parameters for one of our airframes."""

from argparse import Namespace

from rebound_cli.inputs import load_world
from sim_vehicle.hil.parameters import as_airframe_file, as_environment, as_params_file

_FORMATS = {"env": as_environment, "params": as_params_file, "airframe": as_airframe_file}


def run_airframe(options: Namespace) -> int:
    """Print them in the format asked for."""
    airframe = load_world(None, (), options.airframe, None).airframe
    print(_FORMATS[options.format](airframe, options.position))
    return 0
