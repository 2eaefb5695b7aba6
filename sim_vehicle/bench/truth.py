"""What is really so at a moment, as a test reads it, and what has happened, for the report of one that failed."""

import math
from dataclasses import dataclass

from sim_vehicle.quantities import Quaternion, Vector3
from sim_vehicle.truth import FaultSpan, Hit
from sim_vehicle.vehicle import SimulatedVehicle


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


def truth_of(vehicle: SimulatedVehicle) -> Truth:
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


@dataclass(frozen=True, slots=True)
class TimelineEntry:
    """One line of the timeline."""

    time_boot_s: float
    text: str

    def __str__(self) -> str:
        return f"{self.time_boot_s:9.3f} s  {self.text}"


class Timeline:
    """Modes, arming, the vehicle's words, hits and faults, looked at after each interval."""

    def __init__(self, vehicle: SimulatedVehicle) -> None:
        self._vehicle = vehicle
        self._events: list[TimelineEntry] = []
        self._mode, self._is_armed = vehicle.mode, vehicle.is_armed
        self._texts = vehicle.texts
        self._hits = self._begun = 0
        self._open: list[int] = []

    @property
    def events(self) -> tuple[TimelineEntry, ...]:
        """Oldest first; a hit is known when it is over and stands where it began."""
        return tuple(sorted(self._events, key=lambda event: event.time_boot_s))

    def note(self, text: str) -> None:
        """Something that was done to the vehicle."""
        self._events.append(TimelineEntry(self._vehicle.time_boot_us / 1e6, text))

    def look(self) -> None:
        """Note what has changed in the last interval."""
        vehicle = self._vehicle
        if vehicle.is_armed != self._is_armed:
            self._is_armed = vehicle.is_armed
            self.note("armed" if self._is_armed else "disarmed")
        if vehicle.mode != self._mode:
            self._mode = vehicle.mode
            self.note(f"mode {self._mode}")
        if vehicle.texts is not self._texts:
            self._texts = vehicle.texts
            for text in self._texts:
                self.note(f"says ({text.severity.name.lower()}): {text.text}")
        if len(vehicle.truth.hits) != self._hits:
            for hit in vehicle.truth.hits[self._hits :]:
                self._events.append(_of_hit(hit))
            self._hits = len(vehicle.truth.hits)
        if self._open or len(vehicle.truth.faults) != self._begun:
            self._look_at_faults()

    def _look_at_faults(self) -> None:
        spans = self._vehicle.truth.faults
        for index in range(self._begun, len(spans)):
            details = ", ".join(f"{key}: {value}" for key, value in spans[index].details.items())
            self.note(f"fault {spans[index].kind}{details and f' ({details})'}")
            self._open.append(index)
        self._begun = len(spans)
        for index in [index for index in self._open if spans[index].ended_at_boot_us is not None]:
            self._open.remove(index)
            if spans[index].ended_at_boot_us != spans[index].began_at_boot_us:
                self.note(f"fault {spans[index].kind} is over")


def _of_hit(hit: Hit) -> TimelineEntry:
    text = f"hits '{hit.obstacle}' at {hit.closing_speed_m_s:.2f} m/s, for {1e3 * hit.contact_duration_s:.0f} ms"
    return TimelineEntry(1e-6 * hit.contact_at_boot_us, f"{text}, with at most {hit.peak_force_n:.0f} N")
