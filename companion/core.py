"""The pure heart: (core, samples, now) -> messages to send and events. No bytes, no clock, no I/O.

A `Core` belongs to one flight and is changed only by `advance`: the same samples at the same times give the
same outputs, which is what makes a flight replayable.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from companion.detection.interface import Detector, DetectorState, Impact, Phase
from companion.detection.registry import DETECTORS
from companion.estimate.history import REBOOT_US
from companion.flight.connecting import Connect
from companion.flight.context import FlightContext, Inputs
from companion.flight.machine import Machine
from companion.flight.states import FINAL_STATES, State
from companion.link.identity import identify, is_autopilot
from companion.link.streams import StreamMonitor
from companion.link.vehicle import Vehicle
from companion.messages import (
    CommandAck,
    Heartbeat,
    ImuSample,
    LocalPosition,
    OnboardHeartbeat,
    Outgoing,
    PositionSetpoint,
    Sample,
    TimeSyncReply,
    TimeSyncRequest,
)
from companion.mission.model import Mission
from companion.px4_mode import mode_name
from companion.report import Event

# MAVLink's heartbeat microservice: once a second.
HEARTBEAT_INTERVAL_US = 1_000_000
# All timeouts are noticed within this, when nothing arrives.
POLL_INTERVAL_US = 50_000
# Ten samples of the slowest acceptable IMU stream: whoever waits longer for one sees no hit.
IMU_SILENCE_US = 250_000

DETECTING_STATES = frozenset({State.MISSION, State.RECOVERING, State.HOLDING})


@dataclass(frozen=True, slots=True)
class Outputs:
    messages: tuple[Outgoing, ...]
    events: tuple[Event, ...]


@dataclass(slots=True)
class Core:
    """All that is remembered between steps."""

    machine: Machine
    detector: Detector[Any]
    detection: DetectorState
    started_at_us: int
    now_us: int
    heartbeat_due_us: int
    setpoint_due_us: int
    setpoint_interval_us: int
    last_imu_boot_us: int = 0
    last_imu_us: int = 0
    imu_silent: bool = False
    detector_told: bool = False
    stop_reason: str | None = None

    @property
    def flight(self) -> FlightContext:
        return self.machine.flight


def start(mission: Mission, now_us: int) -> Core:
    """A flight before its first step."""
    config = mission.companion
    averaging_us = round(config.estimate.imu_averaging_interval_s * 1e6)
    detector = DETECTORS[config.detector](config.lateral, averaging_us)
    flight = FlightContext(mission, Vehicle(), StreamMonitor(config.streams))
    return Core(
        machine=Machine(flight, Connect(now_us)),
        detector=detector,
        detection=detector.initial(),
        started_at_us=now_us,
        now_us=now_us,
        heartbeat_due_us=now_us,
        setpoint_due_us=now_us,
        setpoint_interval_us=round(1e6 / config.flight.setpoint_hz),
    )


def advance(core: Core, samples: Sequence[Sample], now_us: int) -> Outputs:
    """One step: what was heard, whether it shows a hit, what follows for the flight, what is due to be sent."""
    core.now_us = now_us
    refusal = hear(core, samples, now_us)
    impacts = detect(core, samples, now_us)
    moved = fly(core, samples, impacts, refusal, now_us)
    follow_contact(core)
    stream_setpoint(core, moved, now_us)
    beat(core, now_us)
    return collect(core)


def hear(core: Core, samples: Sequence[Sample], now_us: int) -> str | None:
    """Bring the vehicle view up to date, answer time requests; why the vehicle is refused, or None."""
    flight = core.flight
    vehicle, streams = flight.vehicle, flight.streams
    mode, armed = vehicle.custom_mode, vehicle.armed
    for sample in samples:
        if isinstance(sample, Heartbeat):
            if not is_autopilot(sample):
                continue
            if vehicle.identity is None:
                identity = identify(sample)
                if isinstance(identity, str):
                    return identity
                vehicle.identity = identity
            if sample.system_id != vehicle.identity.system_id:
                continue
        elif isinstance(sample, TimeSyncRequest):
            flight.outbox.append(TimeSyncReply(sample.vehicle_time_ns, now_us * 1000))
        vehicle.hear(sample, now_us)
        streams.count(type(sample), now_us)
    if vehicle.custom_mode != mode and vehicle.custom_mode is not None:
        flight.tell(now_us, "mode", f"mode {mode_name(vehicle.custom_mode)}", custom_mode=vehicle.custom_mode)
    if vehicle.armed is False and armed:
        flight.tell(now_us, "disarmed", "disarmed")
    return None


def detect(core: Core, samples: Sequence[Sample], now_us: int) -> list[Impact]:
    """Every IMU sample through the detector, in the order of their time stamps."""
    impacts: list[Impact] = []
    off_reason = why_not_detecting(core)
    for sample in samples:
        if not isinstance(sample, ImuSample):
            continue
        core.last_imu_us = now_us
        if 0 <= core.last_imu_boot_us - sample.time_boot_us < REBOOT_US:
            continue
        core.last_imu_boot_us = sample.time_boot_us
        core.detection, impact = core.detector.step(core.detection, sample, off_reason)
        if impact is not None:
            impacts.append(impact)
    watch_imu(core, now_us)
    tell_threshold(core, now_us)
    return impacts


def tell_threshold(core: Core, now_us: int) -> None:
    """Once, when the detector is first on the watch: what it takes to be seen as a hit by this vehicle."""
    if core.detector_told or core.detection.phase is not Phase.ARMED:
        return
    core.detector_told = True
    threshold_m_s2 = core.detection.threshold_m_s2
    text = f"detector '{core.detector.name}' on the watch: a hit is {threshold_m_s2:.1f} m/s^2 sideways or more"
    core.flight.tell(now_us, "detector", text, threshold_m_s2=round(threshold_m_s2, 3))


def why_not_detecting(core: Core) -> str | None:
    """Ground, take-off and landing shake a vehicle as a hit does."""
    flight = core.flight
    if core.machine.state not in DETECTING_STATES:
        return core.machine.state.value
    latest = flight.vehicle.history.latest()
    least_m = flight.mission.companion.min_detection_height_m
    if latest is None or flight.origin_ned_m is None or flight.origin_ned_m[2] - latest.position_ned_m[2] < least_m:
        return f"below {least_m:g} m"
    return None


def watch_imu(core: Core, now_us: int) -> None:
    """A detector without samples is blind, and says so."""
    silent = core.machine.state in DETECTING_STATES and now_us - core.last_imu_us > IMU_SILENCE_US
    if silent != core.imu_silent:
        core.imu_silent = silent
        if silent:
            core.flight.tell(now_us, "link", f"detector blind: no HIGHRES_IMU for {IMU_SILENCE_US // 1000} ms")
        elif core.machine.state in DETECTING_STATES:
            core.flight.tell(now_us, "link", "HIGHRES_IMU is back, the detector sees again")


def fly(core: Core, samples: Sequence[Sample], impacts: list[Impact], refusal: str | None, now_us: int) -> bool:
    """Let the state machine act; whether it moved."""
    acks = [sample for sample in samples if isinstance(sample, CommandAck)]
    positions = [sample for sample in samples if isinstance(sample, LocalPosition)]
    inputs = Inputs(acks, positions, impacts, core.stop_reason, refusal)
    core.stop_reason = None
    moved = core.machine.step(inputs, now_us)
    flight = core.flight
    if core.machine.finished and flight.ended_at_us is None:
        flight.ended_at_us = now_us
    return moved


def follow_contact(core: Core) -> None:
    """Let the latest collision's record see the contact's course."""
    if core.flight.collisions:
        core.flight.collisions[-1].follow_contact(core.detection)


def stream_setpoint(core: Core, moved: bool, now_us: int) -> None:
    """The one place setpoints leave from: at their rate, and at once when the flight has moved on."""
    if not moved and now_us < core.setpoint_due_us:
        return
    due_us = core.setpoint_due_us + core.setpoint_interval_us
    core.setpoint_due_us = due_us if not moved and due_us > now_us else now_us + core.setpoint_interval_us
    target = core.machine.activity.target(now_us)
    if target is None:
        return
    core.flight.target = target
    time_us = now_us - core.started_at_us
    core.flight.outbox.append(
        PositionSetpoint(
            time_us, target.position_ned_m, target.yaw_rad, target.velocity_ned_m_s, target.acceleration_ned_m_s2
        )
    )


def beat(core: Core, now_us: int) -> None:
    """Our own HEARTBEAT, for as long as there is anything to do."""
    if now_us < core.heartbeat_due_us or core.machine.finished:
        return
    core.heartbeat_due_us = now_us + HEARTBEAT_INTERVAL_US
    active = core.machine.state not in FINAL_STATES and core.flight.armed_at_us is not None
    core.flight.outbox.append(OnboardHeartbeat(active))


def collect(core: Core) -> Outputs:
    """Empty the outbox and the timeline into the step's outputs."""
    flight = core.flight
    if not flight.outbox and not flight.events:
        return NOTHING
    outputs = Outputs(tuple(flight.outbox), tuple(flight.events))
    flight.outbox, flight.events = [], []
    return outputs


NOTHING = Outputs((), ())


def next_deadline_us(core: Core) -> int:
    """When the next step is due if nothing arrives."""
    if core.stop_reason is not None:
        return core.now_us
    due_us = min(core.heartbeat_due_us, core.now_us + POLL_INTERVAL_US)
    return min(due_us, core.setpoint_due_us) if core.setpoint_due_us > core.now_us else due_us
