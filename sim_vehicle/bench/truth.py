"""What is really so at a moment, as a test reads it."""

import math
from dataclasses import dataclass

from sim_vehicle.bench.changeable import ChangeableVehicle
from sim_vehicle.quantities import Quaternion, Vector3
from sim_vehicle.truth import FaultSpan, Hit


@dataclass(frozen=True, slots=True)
class Truth:
    """The vehicle's state without any sensor's or estimate's error, and what has happened so far."""

    time_boot_s: float
    """Since the vehicle was first switched on."""
    position_ned_m: Vector3
    """Of the centre of mass, in the world."""
    velocity_ned_m_s: Vector3
    attitude_wxyz: Quaternion
    """Body to NED."""
    angular_velocity_frd_rad_s: Vector3
    arm_fold_m: tuple[float, ...]
    """Of each arm, inward, in motor order: of a quad-x front right, rear left, front left, rear right."""
    is_armed: bool
    may_arm: bool
    """Whether the vehicle's checks would let it be armed now, as a ground station shows `ready`."""
    mode: str
    """What flies, by PX4's name: Hold, Takeoff, Offboard ..."""
    hits: tuple[Hit, ...]
    """Contacts with obstacles that are over, oldest first; a contact is over when all has been clear for 20 ms."""
    faults: tuple[FaultSpan, ...]
    """Those that have begun, and when they ended."""

    @property
    def height_m(self) -> float:
        """Above the ground at z = 0."""
        return -self.position_ned_m[2]

    @property
    def speed_m_s(self) -> float:
        return math.hypot(*self.velocity_ned_m_s)


def truth_of(vehicle: ChangeableVehicle) -> Truth:
    """The truth at the end of the last interval."""
    x, y, z, vx, vy, vz, w, qx, qy, qz, p, q, r = vehicle.state.body.tolist()
    return Truth(
        time_boot_s=vehicle.time_boot_us / 1e6,
        position_ned_m=(x, y, z),
        velocity_ned_m_s=(vx, vy, vz),
        attitude_wxyz=(w, qx, qy, qz),
        angular_velocity_frd_rad_s=(p, q, r),
        arm_fold_m=tuple(vehicle.state.fold_m[: vehicle.constants.rotors].tolist()),
        is_armed=vehicle.is_armed,
        may_arm=vehicle.may_arm,
        mode=vehicle.mode,
        hits=tuple(vehicle.truth.hits),
        faults=tuple(vehicle.truth.faults),
    )
