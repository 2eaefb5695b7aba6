"""The plant: a state of arrays, moved by the kernels one IMU interval at a time."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from sim_vehicle.airframe import Airframe
from sim_vehicle.control.asked import AskedSetpoint
from sim_vehicle.control.setpoint import Setpoint
from sim_vehicle.estimator.estimate import Estimate
from sim_vehicle.faults.plan import Faults
from sim_vehicle.physics.estimate import estimate_errors
from sim_vehicle.physics.layout import HIT_ACTIVE, HIT_FACE, Scratch, calm, constants_from, initial_state
from sim_vehicle.physics.record import boxed, new_record
from sim_vehicle.physics.report import HITS_ENDED, KNOWN, REPORT_COLUMNS, SENSED, TRUTH, report_estimate
from sim_vehicle.physics.touching.proximity import points_behind
from sim_vehicle.physics.touching.surroundings import Surroundings
from sim_vehicle.physics.trim import trim
from sim_vehicle.plant import interval
from sim_vehicle.plant.interval import advance_interval
from sim_vehicle.quantities import Floats, Vector3
from sim_vehicle.scene import Scene
from sim_vehicle.truth import TruthRecorder
from sim_vehicle.world import World

if TYPE_CHECKING:
    from sim_vehicle.estimator.onboard import OnboardEstimator


def _onboard_estimator(airframe: Airframe, body: Floats, seed: int) -> "OnboardEstimator":
    # Here, because its Kalman filter brings scipy's statistics, which take half a second to load.
    from sim_vehicle.estimator.onboard import OnboardEstimator

    return OnboardEstimator(airframe, body, seed)


class Plant:
    """Airframe, world and seed in; one interval a step. The same inputs give the same bits."""

    def __init__(self, airframe: Airframe, scene: Scene, seed: int, keeps_path: bool = True) -> None:
        self._rng = np.random.default_rng(seed)
        self.constants = constants_from(airframe, self._rng)
        """What does not change in a flight, but for `tune`."""
        self.disturbance = calm(scene.wind_ned_m_s)
        self._raw_samples = int(self.constants.raw_per_interval)
        north, east, _ = scene.start.position_ned_m
        centre: Vector3 = (north, east, -airframe.geometry.foot_depth_m)
        self.state = initial_state(centre, math.radians(scene.start.yaw_deg))
        self.interval_us = airframe.imu.integration_interval_us
        self.around = Surroundings(scene.world(), centre, 0, self.interval_us)
        self._errors, self._past = estimate_errors(airframe, self.state.body, self._rng)
        self._errors_box = boxed(self._errors)
        self.onboard: OnboardEstimator | None = None
        if airframe.estimate.kind == "ekf":
            self.onboard = _onboard_estimator(airframe, self.state.body, seed)
        self._estimate = self.state.estimate
        self._frame_offset_ned_m = self.state.frame_offset_ned_m
        self._acceleration_ned_m_s2 = self.state.acceleration_ned_m_s2
        self._body = self.state.body
        self._noise = np.empty(6 * self._raw_samples + 9)
        self._report = np.zeros(REPORT_COLUMNS)
        self._true_columns, self._sensed_columns = self._report[TRUTH], self._report[SENSED]
        self._asked = AskedSetpoint()
        self._motor_command_n = self.state.motor_command_n
        self._rotors, self._motor_max_n = airframe.rotor_count, airframe.motors.max_thrust_n
        self._finished_hits = self.state.finished_hits
        self._state_box = boxed(self.state)
        self._constants_box, self._disturbance_box = boxed(self.constants), boxed(self.disturbance)
        self._scratch_box = boxed(new_record(Scratch))
        self.truth = TruthRecorder(keeps_path, airframe.rotor_count, touching=self._touching)
        self.faults = Faults(scene.faults, airframe, scene.wind_ned_m_s, seed, self.state)
        self.truth.faults = self.faults.spans

    def tune(self, gains: Mapping[str, float | Vector3]) -> None:
        """Change gains and limits of the inner loops, by their names in `Gains`."""
        for name, value in gains.items():
            self._constants_box[name] = value

    def change_world(self, world: World) -> None:
        """Put other obstacles around the vehicle, none of them through it; a hit on one that goes is over."""
        if (touching := self._touching()) is not None:
            hit, _ = touching
            row = np.flatnonzero(world.rows_in(self.around.world) == int(hit[HIT_FACE]))
            if len(row) == 0:
                self.truth.add_hit(*touching)
                hit[HIT_ACTIVE] = 0.0
            else:
                hit[HIT_FACE] = row[0]
        x, y, z = self._body[:3].tolist()
        self.around = self.around.changed(world, (x, y, z), int(self.state.time_us))

    def _touching(self) -> tuple[Floats, World] | None:
        hit = self.state.hit
        return (hit, self.around.world) if hit[HIT_ACTIVE] == 1.0 else None

    def place(self, position_ned_m: Vector3, velocity_ned_m_s: Vector3) -> None:
        """Put the level vehicle somewhere in flight, for studies of single hits."""
        self.state.body[0:6] = [*position_ned_m, *velocity_ned_m_s]
        self._look_around(position_ned_m)

    def cruise(self, position_ned_m: Vector3, velocity_ned_m_s: Vector3, yaw_rad: float) -> None:
        """Put the vehicle into a flight that has been steady for a while."""
        remembered = (self._errors, self._past)
        trim(self.state, remembered, self.constants, self.disturbance, position_ned_m, velocity_ned_m_s, yaw_rad)
        self._look_around(position_ned_m)

    def _look_around(self, position_ned_m: Vector3) -> None:
        self.around.behind[:] = points_behind(self.around.faces, position_ned_m)
        if self.onboard is not None:
            self.onboard.start(self.state.body, self.state.time_us)

    def step(self, setpoint: Setpoint | None, armed: bool) -> Estimate:
        """Advance one interval: armed with a setpoint flies it, armed without idles, disarmed is off."""
        motors = (
            interval.MOTORS_OFF if not armed else interval.MOTORS_IDLE if setpoint is None else interval.MOTORS_FLYING
        )
        if setpoint is not None:
            self._asked.take(setpoint)
        return self._advance(motors)

    def drive(self, motor_fractions: Sequence[float]) -> Estimate:
        """Advance one interval under an autopilot from outside: thrust asked of each motor over its greatest."""
        self._motor_command_n[: self._rotors] = motor_fractions[: self._rotors]
        self._motor_command_n *= self._motor_max_n
        return self._advance(interval.MOTORS_DRIVEN)

    def _advance(self, motors: int) -> Estimate:
        around = self.around
        if around.world.movers:
            around.move(int(self.state.time_us))
        if self.faults.acts:
            self.faults.before(self.state, self.disturbance)
        advance_interval(
            self._state_box,
            self._asked.box,
            motors,
            self._rng.standard_normal(out=self._noise),
            self._constants_box,
            self._disturbance_box,
            around.faces,
            around.moving,
            around.behind,
            around.near,
            around.forces,
            self._scratch_box,
            self._errors_box,
            self._past,
            self._report,
        )
        report = self._report
        self.truth.record(self._true_columns)
        if report[HITS_ENDED]:
            for row in self._finished_hits[: int(report[HITS_ENDED])]:
                self.truth.add_hit(row, around.world)
        if self.onboard is not None and motors != interval.MOTORS_DRIVEN:
            self._estimate_state(self.onboard, motors == interval.MOTORS_FLYING)
        return self._output()

    def _estimate_state(self, onboard: "OnboardEstimator", flies: bool) -> None:
        """Let the vehicle's own filter renew what the loops and the telemetry of the next interval go by."""
        estimate, acceleration = self._estimate, self._acceleration_ned_m_s2
        time_us, faces = int(self._report[0]), self.around.flat_faces
        onboard.update(time_us, self._sensed_columns, flies, self._body, faces, estimate, acceleration)
        if self.faults.acts:
            estimate[0:6] += self.disturbance.estimate_jump
        report_estimate(self._body, estimate, acceleration, self._frame_offset_ned_m, self._report)

    def _output(self) -> Estimate:
        onboard, report = self.onboard, self._report.tolist()
        fx, fy, fz, p, q, r, clip_x, clip_y, clip_z, px, py, pz, vx, vy, vz, *others = report[KNOWN]
        qw, qx, qy, qz, ax, ay, az, thrust, *motors = others
        resets = 0 if onboard is None else onboard.reset_counter
        return Estimate(
            int(report[0]),
            (fx, fy, fz),
            (p, q, r),
            (int(clip_x), int(clip_y), int(clip_z)),
            (px, py, pz),
            (vx, vy, vz),
            (ax, ay, az),
            (qw, qx, qy, qz),
            thrust,
            tuple(motors[: self._rotors]),
            resets + self.faults.estimate.reset_counter,
        )
