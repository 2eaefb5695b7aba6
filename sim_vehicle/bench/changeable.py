"""A simulated vehicle around which obstacles and faults may change between two intervals."""

from sim_vehicle.airframe import Airframe
from sim_vehicle.autopilot.mode_numbers import NUMBERS
from sim_vehicle.errors import FaultError, SceneError
from sim_vehicle.faults.spec import Fault, overlapping
from sim_vehicle.mavlink.faulty_link import FaultyLink, check_messages
from sim_vehicle.mavlink.link import Link
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.physics.layout import Constants
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle
from sim_vehicle.world import Obstacle, build_world


class ChangeableVehicle(SimulatedVehicle):
    """The same vehicle. All its links can be disturbed, which costs a link some microseconds an interval."""

    def __init__(
        self, airframe: Airframe, scene: Scene, seed: int, epoch_at_boot_us: int, parameters: dict[str, float]
    ) -> None:
        self._reach_m = airframe.geometry.reach_m
        self._faults: list[Fault] = list(scene.faults)
        super().__init__(airframe, scene, seed, epoch_at_boot_us=epoch_at_boot_us, parameters=parameters)

    def _new_link(self, kind: LinkKind, number: int, seed: int) -> Link:
        return FaultyLink(kind, self._board, number, seed, self._faults)

    @property
    def constants(self) -> Constants:
        """What does not change in a flight."""
        return self._plant.constants

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """Everything that the vehicle can run into but the ground."""
        return self._plant.world.obstacles

    @property
    def is_armed(self) -> bool:
        return self._autopilot.arming.armed

    @property
    def may_arm(self) -> bool:
        """Whether its checks would let it be armed now."""
        return self._autopilot.commander.checks_pass

    @property
    def mode(self) -> str:
        """What flies, by PX4's name."""
        return NUMBERS[self._autopilot.modes.flown].title

    def place(self, obstacles: tuple[Obstacle, ...]) -> None:
        """Put obstacles where they are described. Raises SceneError, and places none, if one is in the vehicle."""
        x, y, z = self.state.body[:3].tolist()
        for obstacle in obstacles:
            dx, dy, dz = (0.0, 0.0, 0.0) if obstacle.motion is None else obstacle.motion.offset_ned_m(self._now_s)
            distance_m = obstacle.distance_m((x - dx, y - dy, z - dz))
            if distance_m < self._reach_m:
                raise SceneError(
                    f"'{obstacle.name}' would pass through the vehicle, which is at "
                    f"({x:.2f}, {y:.2f}, {z:.2f}) m and needs {self._reach_m:.2f} m around it; place it further away."
                )
        self.put(obstacles)

    def put(self, obstacles: tuple[Obstacle, ...]) -> None:
        """The same for obstacles that are known to be clear of the vehicle, however near."""
        self._plant.change_world(build_world((*self.obstacles, *obstacles)))

    def remove(self, obstacles: tuple[Obstacle, ...]) -> None:
        """Take away what was placed."""
        gone = {id(obstacle) for obstacle in obstacles}
        self._plant.change_world(build_world(tuple(kept for kept in self.obstacles if id(kept) not in gone)))

    def add_fault(self, fault: Fault) -> None:
        """One more fault from now on. Raises FaultError for one that does not fit those that are there."""
        check_messages(fault)
        problem = overlapping((*self._faults, fault))
        if problem is not None:
            raise FaultError(f"{problem}.")
        self._faults.append(fault)
        self._plant.add_fault(fault)
        for link in self._links:
            if isinstance(link, FaultyLink):
                link.add(fault)

    def remove_fault(self, fault: Fault) -> None:
        """End or cancel a fault: the same object that was added."""
        self._faults = [kept for kept in self._faults if kept is not fault]
        self._plant.remove_fault(fault)
        for link in self._links:
            if isinstance(link, FaultyLink):
                link.remove(fault)

    @property
    def _now_s(self) -> float:
        return self.time_boot_us / 1e6
