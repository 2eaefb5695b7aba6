"""What the links of one vehicle have in common."""

from dataclasses import dataclass

from sim_vehicle.autopilot.autopilot import Autopilot
from sim_vehicle.autopilot.messages import Identity
from sim_vehicle.mavlink.signing import Signing
from sim_vehicle.mavlink.streams.topics import Topics
from sim_vehicle.mavlink.telemetry import Telemetry
from sim_vehicle.parameters.store import Parameters


@dataclass(frozen=True, slots=True)
class Board:
    """The vehicle's software, as its links reach it."""

    identity: Identity
    autopilot: Autopilot
    parameters: Parameters
    telemetry: Telemetry
    topics: Topics
    signing: Signing
    interval_us: int
    """Of the inertial samples, and so of the vehicle's steps."""
    booted_at_us: int = 0
    """When its clock began, of the clock by which faults come and go."""
