"""The table of what every link offers: one line a protocol."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from sim_vehicle.mavlink.services.board import Board
from sim_vehicle.mavlink.services.command_service import CommandService
from sim_vehicle.mavlink.services.file_service import FileService
from sim_vehicle.mavlink.services.mission_service import MissionService
from sim_vehicle.mavlink.services.parameter_service import ParameterService
from sim_vehicle.mavlink.services.service import Service
from sim_vehicle.mavlink.services.setpoint_service import SetpointService
from sim_vehicle.mavlink.services.timesync_service import TimeSyncService

if TYPE_CHECKING:
    from sim_vehicle.mavlink.link import Link

# In the order in which they are brought up to date in an interval.
SERVICES: "tuple[Callable[[Link, Board], Service], ...]" = (
    CommandService,
    TimeSyncService,
    SetpointService,
    ParameterService,
    MissionService,
    FileService,
)
