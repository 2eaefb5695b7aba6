"""What really happened: every hit and the path, recorded beside the simulation and never sent by it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sim_vehicle.airframe import MOST_ROTORS
from sim_vehicle.physics import layout
from sim_vehicle.quantities import Floats, Vector3, vector
from sim_vehicle.world import World

# Columns of one row of the path: time, position, velocity, attitude, contact force, folds.
_ROW = 1 + 3 + 3 + 4 + 1 + MOST_ROTORS


@dataclass(frozen=True, slots=True)
class Hit:
    """One contact with an obstacle, from the first touch until everything was clear for 20 ms."""

    obstacle: str
    contact_at_boot_us: float
    ended_at_boot_us: float
    contact_position_ned_m: Vector3
    """The centre of mass at the first touch."""
    impact_velocity_ned_m_s: Vector3
    normal_ned: Vector3
    """Out of the surface that was hit, where it was touched first."""
    max_fold_m: float
    peak_force_n: float
    rebound_velocity_ned_m_s: Vector3
    """The centre of mass's at the last touch."""
    impulse_ned_n_s: Vector3
    """Of the obstacle on the vehicle, friction included."""
    energy_before_j: float
    """Kinetic, moving and turning, at the first touch, as seen from the obstacle."""
    energy_after_j: float
    """The same at the last touch."""
    kind: str = "wall"
    """wall, ceiling, floor, edge or pole."""
    contact_point_ned_m: Vector3 | None = None
    """On the surface, where it was touched first and hardest."""
    surface_velocity_ned_m_s: Vector3 = (0.0, 0.0, 0.0)
    """Of the obstacle at the first touch."""
    frame_offset_ned_m: Vector3 = (0.0, 0.0, 0.0)
    """Estimated less true position at the first touch, NED; without the estimate's delay."""

    @property
    def contact_duration_s(self) -> float:
        """From the first touch to the last."""
        return 1e-6 * (self.ended_at_boot_us - self.contact_at_boot_us)

    @property
    def closing_speed_m_s(self) -> float:
        """How fast the centre of mass came towards the surface, which may move itself."""
        came = zip(self.impact_velocity_ned_m_s, self.surface_velocity_ned_m_s, self.normal_ned, strict=True)
        return -sum((v - s) * n for v, s, n in came)

    @property
    def rebound_speed_m_s(self) -> float:
        """Speed along the face's normal at the last touch, away positive."""
        return sum(v * n for v, n in zip(self.rebound_velocity_ned_m_s, self.normal_ned, strict=True))


@dataclass(frozen=True, slots=True)
class FaultSpan:
    """A fault that a mission asked for, and when it acted."""

    kind: str
    began_at_boot_us: int
    ended_at_boot_us: int | None
    """None while it acts."""
    details: dict[str, Any]
    """As the mission file has it."""


def clock_jumps(faults: Iterable[FaultSpan]) -> list[tuple[int, int]]:
    """Boot times from which on the vehicle's messages had later ones, and by how much, microseconds."""
    jumps = (fault for fault in faults if fault.kind == "clock_jump")
    return [(fault.began_at_boot_us, round(1e6 * fault.details["jump_s"])) for fault in jumps]


@dataclass(slots=True)
class TruthRecorder:
    """Grows with the flight; ``keeps_path`` off leaves only the hits, for flights without an end."""

    keeps_path: bool = True
    rotors: int = 4
    hits: list[Hit] = field(default_factory=list)
    faults: list[FaultSpan] = field(default_factory=list)
    on_hit: Callable[[Hit], None] | None = None
    """Told of each as soon as it is over."""
    touching: Callable[[], tuple[Floats, World] | None] = lambda: None
    """The row of the hit that is not over, and its world."""
    _path: bytearray = field(default_factory=bytearray)

    def record(self, row: Floats) -> None:
        """Add the true columns of a report to the path."""
        if self.keeps_path:
            self._path += row.tobytes()

    def add_hit(self, row: Floats, world: World) -> None:
        """Add a finished row of `PlantState.finished_hits`."""
        hit = _hit(row, world)
        self.hits.append(hit)
        if self.on_hit is not None:
            self.on_hit(hit)

    def hits_so_far(self) -> list[Hit]:
        """The one that is not over as it has been so far: a vehicle that lies against a wall touches it to the end."""
        touching = self.touching()
        return self.hits if touching is None else [*self.hits, _hit(*touching)]

    def series(self) -> dict[str, Floats]:
        """The path, one row an IMU interval: arrays by name, each with frame and unit in it."""
        rows = np.frombuffer(bytes(self._path)).reshape(-1, _ROW)
        return {
            "time_boot_us": rows[:, 0],
            "position_ned_m": rows[:, 1:4],
            "velocity_ned_m_s": rows[:, 4:7],
            "attitude_wxyz": rows[:, 7:11],
            "arm_fold_m": rows[:, 12 : 12 + self.rotors],
            "peak_contact_force_n": rows[:, 11],
        }


def _hit(row: Floats, world: World) -> Hit:
    """Of a row of `PlantState`."""
    return Hit(
        obstacle=world.names[int(row[layout.HIT_FACE])],
        contact_at_boot_us=float(row[layout.HIT_START_US]),
        ended_at_boot_us=float(row[layout.HIT_LAST_US]),
        contact_position_ned_m=vector(row[layout.HIT_POSITION]),
        impact_velocity_ned_m_s=vector(row[layout.HIT_VELOCITY]),
        normal_ned=vector(row[layout.HIT_NORMAL]),
        max_fold_m=float(row[layout.HIT_FOLD_M]),
        peak_force_n=float(row[layout.HIT_PEAK_N]),
        rebound_velocity_ned_m_s=vector(row[layout.HIT_EXIT_VELOCITY]),
        impulse_ned_n_s=vector(row[layout.HIT_IMPULSE]),
        energy_before_j=float(row[layout.HIT_ENERGY_BEFORE_J]),
        energy_after_j=float(row[layout.HIT_ENERGY_AFTER_J]),
        kind=world.kinds[int(row[layout.HIT_FACE])],
        contact_point_ned_m=vector(row[layout.HIT_POINT]),
        surface_velocity_ned_m_s=vector(row[layout.HIT_SURFACE_VELOCITY]),
        frame_offset_ned_m=vector(row[layout.HIT_FRAME_OFFSET]),
    )
