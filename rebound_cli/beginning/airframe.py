"""`rebound airframe`: an autopilot's parameters for one of our airframes."""

from argparse import Namespace

from companion.errors import ConfigurationError
from rebound_cli.inputs.inputs import load_world
from rebound_cli.simulation.compiling import stand_own
from sim_vehicle.hil.parameters import as_airframe_file, as_environment, as_params_file
from sim_vehicle.json.parameters import as_parameter_file
from sim_vehicle.json.vehicle import check_rotors

_FORMATS = {"env": as_environment, "params": as_params_file, "airframe": as_airframe_file}


def run_airframe(options: Namespace) -> None:
    """Print them in the format asked for."""
    world = load_world(None, (), options.airframe, None)
    stand_own(world)
    airframe = world.airframe
    if options.target == "px4":
        print(_FORMATS[options.format or "env"](airframe, options.position or "mocap"))
    elif options.format is not None or options.position is not None:
        raise ConfigurationError("--format and --position belong to px4: leave them out for ArduPilot.")
    else:
        check_rotors(airframe)
        print(as_parameter_file(airframe))
