"""The simulated vehicle: MAVLink bytes in, one interval of flight, MAVLink bytes out."""

import math
from collections.abc import Mapping

from sim_vehicle.airframe import Airframe
from sim_vehicle.autopilot.autopilot import POSITION_PERIOD_US, Autopilot
from sim_vehicle.autopilot.flight_tasks.target import Kind, NavigatorTarget
from sim_vehicle.autopilot.messages import Identity, StatusText
from sim_vehicle.autopilot.mode_numbers import NUMBERS
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.errors import FaultError, SceneError
from sim_vehicle.estimator.estimate import Estimate
from sim_vehicle.faults.spec import Fault, overlapping
from sim_vehicle.hil.slow_sensors import SlowSensors
from sim_vehicle.mavlink.faulty_link import FaultyLink, check_messages, needs_faulty_link
from sim_vehicle.mavlink.link import Link
from sim_vehicle.mavlink.services.service import Board
from sim_vehicle.mavlink.signing import Signing
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.mavlink.streams.topics import Topics
from sim_vehicle.mavlink.telemetry import Telemetry
from sim_vehicle.parameters.airframe_values import defaults_from, position_gains, with_parameters
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.plant.plant import Plant
from sim_vehicle.plant.standing import check_start
from sim_vehicle.quantities import Vector3
from sim_vehicle.scene import Scene
from sim_vehicle.world import Obstacle, build_world, distance_m

# A signature has one byte for the link.
_LINK_NUMBERS = 256
# A vehicle that begins in flight is on the way to where it would be after so long: further than any study of a hit.
FAR_S = 60.0


class SimulatedVehicle:
    """Airframe, world and seed in; the same bytes in give the same bytes out."""

    def __init__(
        self,
        airframe: Airframe,
        scene: Scene,
        seed: int,
        keeps_path: bool = True,
        epoch_at_boot_us: int = 0,
        parameters: Mapping[str, float] | None = None,
        signing: Signing | None = None,
        links_may_fail: bool = False,
    ) -> None:
        """``keeps_path`` off: the truth holds the hits but no path, for a simulation without an end.

        ``epoch_at_boot_us``: Unix time when the vehicle's clock was at zero, which it tells who asks for the time.
        ``parameters``: values in place of PX4's defaults and the airframe's.
        ``signing``: the key that it has.
        ``links_may_fail``: faults of the wire may come later, which costs a link some microseconds an interval.

        Raises SceneError where a wall passes through the start position, or the wind is too strong.
        """
        check_start(airframe, scene)
        self._airframe, self._seed = airframe, seed
        self._links: list[Link] = []
        self._links_may_fail = links_may_fail
        self.texts: tuple[StatusText, ...] = ()
        self._links_so_far = 0
        self._companion_link: Link | None = None
        self.parameters = Parameters(defaults_from(airframe))
        for name, value in (parameters or {}).items():
            self.parameters.set(name, value)
        self._plant = Plant(with_parameters(airframe, self.parameters), scene, seed, keeps_path)
        self.state, self.constants = self._plant.state, self._plant.constants
        self.truth = self._plant.truth
        """What really happened, never sent."""
        # A first interval at rest: a vehicle that can be talked to has already seen its sensors.
        first = self._plant.step(None, armed=False)
        self._autopilot = Autopilot(airframe.hover_fraction, first, self.parameters)
        self._positioning = self._autopilot.commander.positioning
        self._positioning.sees_ground = self._plant.onboard is not None
        # Taken once: looking a record's field up costs microseconds.
        self._body = self.state.body
        identity = Identity(int(self.parameters["MAV_SYS_ID"]), int(self.parameters["MAV_COMP_ID"]))
        self._slow = SlowSensors(airframe, self._seed, self._autopilot.origin)
        self._telemetry = Telemetry(
            sample=first,
            published=first,
            autopilot=self._autopilot,
            slow=self._slow,
            position_variance_m2=airframe.estimate.position_noise_m**2,
            velocity_variance_m2_s2=airframe.estimate.velocity_noise_m_s**2,
            attitude_variance_rad2=airframe.estimate.attitude_noise_rad**2,
            attitude_setpoint=self.state.attitude_setpoint,
            epoch_at_boot_us=epoch_at_boot_us,
            system=identity.system,
        )
        self.interval_us = self._plant.interval_us
        self.time_boot_us = int(self.state.time_us)
        self._topics = Topics(self._telemetry)
        self._board = Board(
            identity, self._autopilot, self._telemetry, self._topics, signing or Signing(), self.interval_us
        )
        self._tuned_at = 0

    def begin_in_flight(self, position_ned_m: Vector3, velocity_ned_m_s: Vector3, yaw_rad: float | None = None) -> None:
        """Instead of on the ground: in HOLD, nose ahead or as said, steadily on the way to a place far ahead."""
        north, east, down = position_ned_m
        v_north, v_east, v_down = velocity_ned_m_s
        yaw_rad = math.atan2(v_east, v_north) if yaw_rad is None else yaw_rad
        self._plant.cruise(position_ned_m, velocity_ned_m_s, yaw_rad)
        steady = TrajectorySetpoint(position_ned_m, velocity_ned_m_s, yaw_rad=yaw_rad)
        sample = self._plant.step(steady, armed=True)
        self._autopilot.observe(sample)
        goal = (north + FAR_S * v_north, east + FAR_S * v_east, down + FAR_S * v_down)
        speed_m_s = math.hypot(v_north, v_east)
        self._autopilot.begin_in_flight(NavigatorTarget(Kind.HOLD, goal, yaw_rad, speed_m_s))
        self.time_boot_us = sample.time_boot_us

    def add_link(self, kind: LinkKind) -> Link:
        """One more connection, from now on."""
        number, seed = self._links_so_far % _LINK_NUMBERS, self._seed + self._links_so_far
        faults = self._plant.faults.known
        is_faulty = self._links_may_fail or needs_faulty_link(faults)
        parts = kind, self._board, number, seed
        link = FaultyLink(*parts, faults) if is_faulty else Link(*parts)
        self._links_so_far += 1
        self._links.append(link)
        return link

    def remove_link(self, link: Link) -> None:
        """The connection has ended."""
        self._links.remove(link)
        link.close()

    # --- what may be changed between two intervals ---------------------------------------------------------

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """Everything that the vehicle can run into but the ground."""
        return self._plant.around.world.obstacles

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
        reach_m = self._airframe.geometry.reach_m
        x, y, z = self.state.body[:3].tolist()
        for obstacle in obstacles:
            if distance_m(obstacle, (x, y, z), self.time_boot_us / 1e6) < reach_m:
                raise SceneError(
                    f"'{obstacle.name}' would pass through the vehicle, which is at "
                    f"({x:.2f}, {y:.2f}, {z:.2f}) m and needs {reach_m:.2f} m around it; place it further away."
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
        problem = overlapping((*self._plant.faults.known, fault))
        if problem is not None:
            raise FaultError(f"{problem}.")
        self._plant.faults.add(fault)
        for link in self._links:
            if isinstance(link, FaultyLink):
                link.add(fault)

    def remove_fault(self, fault: Fault) -> None:
        """End or cancel a fault: the same object that was added."""
        self._plant.faults.remove(fault, self.time_boot_us)
        for link in self._links:
            if isinstance(link, FaultyLink):
                link.remove(fault)

    # --- an interval ---------------------------------------------------------------------------------------

    def step(self, received: bytes) -> tuple[bytes, ...]:
        """One interval for a lone companion: apply the bytes received since the last, return the packets to send."""
        link = self._companion_link
        if link is None:
            link = self._companion_link = self.add_link(LinkKind.ONBOARD)
        link.push(received)
        self.advance()
        return link.take()

    def advance(self) -> None:
        """One interval: act on what the links have received, fly, leave what they are to send."""
        self._communicate()
        if self.parameters.sets != self._tuned_at:
            self._tuned_at = self.parameters.sets
            self._plant.tune(position_gains(self.parameters))
        autopilot = self._autopilot
        sample = self._plant.step(autopilot.run_control(), autopilot.motors_run)
        autopilot.observe(sample)
        self.time_boot_us = sample.time_boot_us
        self._topics.count(new_position=self._publish(sample))
        texts = self.texts = tuple(autopilot.texts)
        autopilot.texts.clear()
        for link in self._links:
            link.update(sample.time_boot_us, texts)

    def _communicate(self) -> None:
        # The commander runs beside the receivers: it answers in the interval after a command came.
        acks = self._autopilot.run_commander()
        for link in self._links:
            if acks:
                link.acknowledge(acks)
            foreign = link.receive()
            for other in self._links:
                if other is not link:
                    other.forward(foreign)

    def _publish(self, sample: Estimate) -> bool:
        """Hand the sample to the streams; whether position and velocity are published with it."""
        telemetry = self._telemetry
        telemetry.sample = sample
        onboard = self._plant.onboard
        if onboard is not None:
            telemetry.flow, telemetry.range = onboard.flow, onboard.range
        faults, positioning = self._plant.faults, self._positioning
        if faults.acts:
            positioning.gps_is_jammed = faults.gps_is_lost(self.time_boot_us / 1e6)
            self._autopilot.battery.supply_share = faults.motors.voltage_share
        if sample.time_boot_us >= self._slow.due_us:
            self._slow.update(sample.time_boot_us, self._body, positioning.is_without_gps)
        if sample.time_boot_us - telemetry.published.time_boot_us < POSITION_PERIOD_US:
            return False
        telemetry.published = sample
        if onboard is not None:
            position, velocity, attitude = onboard.variances()
            telemetry.position_variance_m2, telemetry.velocity_variance_m2_s2 = position, velocity
            telemetry.attitude_variance_rad2 = attitude
        return True
