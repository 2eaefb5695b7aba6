"""Hits of the plant alone, recorded; what a companion hears of them at other rates; what detectors find.

The simulated vehicle's own streams and encoders send it, the companion's decoder reads it.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np

from bench.cases.hits import HEIGHT_M, POLE_OFFSET_SHARES, Floats, HitCase, obstacle_before, velocity_towards
from bench.detectors.config import BaselineConfig
from companion.link.streams import wanted_streams
from companion.mavlink.decode import Decoder
from companion.messages import LandedState, MessageId, Sample
from companion.mission.config import CompanionConfig
from companion.reflex.detection.detector import Situation
from companion.reflex.detection.impact import ImpactEstimate
from companion.reflex.detection.monitor import advance, start_monitor
from sim_vehicle.airframe import Airframe
from sim_vehicle.autopilot.autopilot import POSITION_PERIOD_US
from sim_vehicle.autopilot.messages import Identity
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.estimator.estimate import Estimate
from sim_vehicle.mavlink.encode import Encoder
from sim_vehicle.mavlink.streams.streams import KINDS, LateLoops, Stream, interval_from_request
from sim_vehicle.mavlink.streams.topics import Topic
from sim_vehicle.mavlink.telemetry import Telemetry, VibrationMetrics
from sim_vehicle.physics.layout import HIT_ACTIVE, HIT_IMPULSE, HIT_START_US
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit

Vector3 = tuple[float, float, float]
Packets = tuple[int, int, Sequence[bytes]]
"""The interval's number, the boot time, and what is on the wire then."""
VEHICLE = Identity(1, 1)


@dataclass(slots=True)
class VehicleRecording:
    """One entry an interval in each list. `published` is the state estimate as of 8 ms, as PX4 publishes it."""

    samples: list[Estimate] = field(default_factory=list)
    published: list[Estimate] = field(default_factory=list)
    asked_attitudes: list[Floats] = field(default_factory=list)
    """Rotation matrices that the position control asked for."""
    situations: list[Situation] = field(default_factory=list)
    contact_m_s2: list[float] = field(default_factory=list)
    """The obstacles' mean force on the vehicle over the interval, per unit mass. The ground's is not in it."""
    _state: tuple[Floats, Floats] | None = None
    """Views of the plant's state, taken once: looking a field up costs microseconds."""
    _impulse: tuple[float, Vector3] = (0.0, (0.0, 0.0, 0.0))

    def add(self, plant: Plant, sample: Estimate, situation: Situation, mass_kg: float) -> None:
        """Take an interval that the plant has just advanced by."""
        latest = self.published[-1] if self.published else sample
        is_due = sample.time_boot_us - latest.time_boot_us >= POSITION_PERIOD_US
        self.samples.append(sample)
        self.published.append(sample if is_due else latest)
        if self._state is None:
            self._state = plant.state.hit, plant.state.attitude_setpoint
        self.asked_attitudes.append(self._state[1].copy())
        self.situations.append(situation)
        self.contact_m_s2.append(self._contact_n_s(self._state[0]) / (mass_kg * 1e-6 * plant.interval_us))

    def _contact_n_s(self, hit: Floats) -> float:
        """Size of the impulse that the obstacles gave in the latest interval."""
        started_us = float(hit[HIT_START_US])
        if started_us == 0.0:
            return 0.0
        x, y, z = hit[HIT_IMPULSE].tolist()
        before = self._impulse[1] if started_us == self._impulse[0] else (0.0, 0.0, 0.0)
        self._impulse = (started_us, (x, y, z))
        return math.dist((x, y, z), before)


@dataclass(frozen=True, slots=True)
class HeardStep:
    """The samples that arrive at a time; `index` is the recording's interval, whose situation the companion knows."""

    index: int
    time_boot_us: int
    samples: tuple[Sample, ...]


def heard(recording: VehicleRecording, asked_hz: Mapping[MessageId, float], seed: int) -> list[HeardStep]:
    """All that arrives on a link that is asked for these rates when the recording begins."""
    decoder, arrived = Decoder(), []
    decoder.listen_to(VEHICLE.system, VEHICLE.component)
    for index, now_us, packets in _sent(recording, asked_hz, seed):
        samples = tuple(sample for _, sample in decoder.feed(b"".join(packets)) if sample is not None)
        if samples:
            arrived.append(HeardStep(index, now_us, samples))
    return arrived


def _sent(recording: VehicleRecording, asked_hz: Mapping[MessageId, float], seed: int) -> Iterator[Packets]:
    """What the vehicle sends at the end of each interval."""
    samples, encoder, loops = recording.samples, Encoder(VEHICLE), LateLoops(seed)
    streams = [Stream(kind, samples[0].time_boot_us) for kind in KINDS if kind.message_id in asked_hz]
    for stream in streams:
        stream.set_interval(interval_from_request(1e6 / asked_hz[MessageId(stream.kind.message_id)]))
    unknown: Any = None
    state = Telemetry(samples[0], samples[0], unknown, VibrationMetrics(), 0.0, 0.0, 0.0)
    # The first interval is there before anybody asks.
    for index in range(1, len(samples)):
        state.sample, state.published = samples[index], recording.published[index]
        state.attitude_setpoint = recording.asked_attitudes[index]
        state.autopilot = cast(Any, recording.situations[index])  # it is asked for the landed state alone
        state.vibration.update(state.sample.specific_force_frd_m_s2, state.sample.angular_velocity_frd_rad_s)
        now_us, packets = state.sample.time_boot_us, []
        if not loops.misses_this_one():
            for stream in streams:
                version = state.published.time_boot_us if stream.kind.topic is Topic.POSITION else now_us
                if now_us > stream.due_after_us and version != stream.seen:
                    stream.seen = version
                    stream.sent(now_us)
                    packets.append(encoder.packet(stream.kind.build(state)))
        yield index, now_us, packets


# --- the flight

# The detector learns the vehicle: its shaking in 0.5 s, how its velocity keeps to its accelerometer in 20 velocities at
# 30 Hz; the velocity filter looks back 0.5 s.
FREE_FLIGHT_S = (1.5, 1.9)
SWITCHED_ON_AFTER_S = 0.5
# Touches later than planned: a slow vehicle whose last centimetres were not in the plan.
PATIENCE_S = 3.0
# From the first touch on: the longest contact is 0.12 s, its aftermath is in the velocity after 0.1 s more.
FOLLOWED_S = 0.45


class NoTouch(Exception):  # noqa: N818 - reads as the sentence it is
    """The vehicle went past the obstacle: the case is at fault, not a detector."""


def hit_of(case: HitCase, airframe: Airframe) -> tuple[VehicleRecording, Hit]:
    """The case's flight; one past a pole is flown again nearer to its middle. Raises NoTouch."""
    for share in POLE_OFFSET_SHARES[:-1] if case.approach == "pole" else ():
        with suppress(NoTouch):
            return fly_hit(case, airframe, share)
    return fly_hit(case, airframe, POLE_OFFSET_SHARES[-1])


def fly_hit(
    case: HitCase, airframe: Airframe, offset_share: float = POLE_OFFSET_SHARES[0]
) -> tuple[VehicleRecording, Hit]:
    """Straight on into the obstacle, and on for a moment. Raises NoTouch."""
    rng = np.random.default_rng([case.seed, 1])
    velocity = velocity_towards(case, airframe, rng)
    free_s = float(rng.uniform(*FREE_FLIGHT_S))
    start = np.array([0.0, 0.0, -HEIGHT_M])
    yaw_rad = float(rng.uniform(-math.pi, math.pi))
    obstacle = obstacle_before(case, airframe, start + free_s * velocity, velocity, rng, offset_share)
    scene = Scene.model_validate(obstacle)
    plant = Plant(airframe, scene, case.seed)
    plant.cruise(_triple(start), _triple(velocity), yaw_rad)
    # The setpoint keeps to what the vehicle believes, which is late; else it would hurry after it.
    late_us = round(1e6 * airframe.estimate.delay_s) if airframe.estimate.kind == "markov" else 0
    recording, interval_s = VehicleRecording(), 1e-6 * airframe.imu.integration_interval_us
    truth, hit_row = plant.truth, plant.state.hit
    left = round((free_s + PATIENCE_S) / interval_s)
    touched = False
    steps = 0
    while left > 0:
        believed_ned_m = _triple(start + 1e-6 * (plant.state.time_us - late_us) * velocity)
        output = plant.step(TrajectorySetpoint(believed_ned_m, _triple(velocity), yaw_rad=yaw_rad), armed=True)
        steps += 1
        left -= 1
        flown_s, height_m = steps * interval_s, -output.position_ned_m[2]
        asked_ned_m, off_reason = (
            _triple(start + flown_s * velocity),
            "takeoff" if flown_s < SWITCHED_ON_AFTER_S else None,
        )
        situation = Situation(off_reason, True, LandedState.IN_AIR, height_m, setpoint_position_ned_m=asked_ned_m)
        recording.add(plant, output, situation, airframe.mass_kg)
        if not touched and hit_row[HIT_ACTIVE] == 1.0:
            touched, left = True, round(FOLLOWED_S / interval_s)
    if not touched:
        raise NoTouch(f"{case.approach} at {case.speed_m_s} m/s was missed")
    if not truth.hits:
        # Still leaning on it: what has happened so far is the hit.
        truth.add_hit(hit_row, scene.world())
    return recording, truth.hits[0]


def _triple(vector: Floats) -> Vector3:
    return float(vector[0]), float(vector[1]), float(vector[2])


# --- what detectors find

# HIGHRES_IMU asked for, and what a client of PX4 receives of it.
ASKED_HZ = {50: 50.0, 100: 100.0, 246: 250.0}

FLOWN_WITH = BaselineConfig().detector
"""The detector of a drone."""

# A hit that is reported no later than this after its first touch has been found.
FOUND_WITHIN_US = 400_000


@dataclass(slots=True)
class Found:
    """A reported collision: when its sample was heard, its estimate then, and the final one if there was one."""

    time_boot_us: int
    first: ImpactEstimate
    final: ImpactEstimate


def streams_asked_hz(rate: int) -> dict[MessageId, float]:
    """What is asked of the plant for all detectors together, HIGHRES_IMU at the rate. It has no modes."""
    wanted = wanted_streams(CompanionConfig().streams, tuple(MessageId))
    asked_hz: dict[MessageId, float] = {stream.message_id: stream.asked_hz for stream in wanted}
    del asked_hz[MessageId.CURRENT_MODE]
    return asked_hz | {MessageId.HIGHRES_IMU: ASKED_HZ[rate]}


def watch_all(
    config: CompanionConfig, heard: Sequence[HeardStep], situations: Sequence[Situation]
) -> tuple[list[Found], list[ImpactEstimate]]:
    """Collisions reported, and touches that were reported as none."""
    monitor = start_monitor(config, heard[0].time_boot_us)
    found: list[Found] = []
    touches: list[ImpactEstimate] = []
    for step in heard:
        impacts, _ = advance(monitor, step.samples, situations[step.index], step.time_boot_us)
        for estimate in impacts:
            if estimate.impact.is_collision:
                found.append(Found(step.time_boot_us, estimate, estimate))
            else:
                touches.append(estimate)
        latest = monitor.estimator.estimate
        if found and latest is not None and latest.impact is found[-1].first.impact:
            found[-1].final = latest
    return found, touches
