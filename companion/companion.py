"""The companion as a step function: bytes and the time in, bytes and events out."""

import math
from dataclasses import dataclass

from companion.core import Core, advance, fault, next_deadline_us, start
from companion.flight.plan import plan_text
from companion.flight.remembering import all_known
from companion.flight.states import State
from companion.mavlink.decode import Decoder
from companion.mavlink.encode import Encoder
from companion.memory.patch import Patch
from companion.messages import ComputerStatus
from companion.mission.model import Mission
from companion.px4_mode import mode_name
from companion.report import Event, ExpectationReport, FlightReport, Status


@dataclass(frozen=True, slots=True)
class StepResult:
    """`received_frames` holds the packets found in what was received, in order; bad bytes as they came.

    A packet that is not complete yet appears in the step that completes it.
    """

    received_frames: tuple[bytes, ...]
    sent_frames: tuple[bytes, ...]
    events: tuple[Event, ...]


class Companion:
    """Joins the codec with the pure core; holds no clock and no socket. Times are microseconds, any epoch."""

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._decoder = Decoder()
        self._encoder = Encoder()
        self._addressed = False
        self._core: Core | None = None
        self._stop_reason: str | None = None
        self._confirmed = False

    def step(self, received: bytes, now_us: int) -> StepResult:
        """Call with the bytes received since the last call, or b"" when only time has passed."""
        core = self._core or self._begin(now_us)
        frames = self._decoder.feed(received) if received else []
        samples = [sample for _, sample in frames if sample is not None]
        outputs = advance(core, samples, now_us)
        self._address(core)
        sent = self._encoder.all_packets(outputs.messages, lambda error: fault(core, error, now_us))
        return StepResult(tuple([frame for frame, _ in frames]), sent, outputs.events)

    def _begin(self, now_us: int) -> Core:
        self._core = core = start(self._mission, now_us)
        core.flight.plan_confirmed = self._confirmed
        core.stop_reason = self._stop_reason
        return core

    def _address(self, core: Core) -> None:
        """Once the vehicle is known, listen to it alone and speak to it by name."""
        identity = core.flight.vehicle.identity
        if identity is not None and not self._addressed:
            self._addressed = True
            self._decoder.listen_to(identity.system_id, identity.component_id)
            self._encoder.speak_to(identity.system_id, identity.component_id)

    def next_deadline_us(self) -> int:
        """When `step(b"", now)` is due if nothing arrives before; in the past when it is due at once."""
        return 0 if self._core is None else next_deadline_us(self._core)

    def confirm_plan(self) -> None:
        """The person agrees to the plan; may be said beforehand."""
        self._confirmed = True
        if self._core is not None:
            self._core.flight.plan_confirmed = True

    @property
    def core(self) -> Core | None:
        """What is remembered between steps, for whoever studies a flight; None before the first."""
        return self._core

    @property
    def plan_is_confirmed(self) -> bool:
        return self._confirmed if self._core is None else self._core.flight.plan_confirmed

    @property
    def stop_reason(self) -> str | None:
        """What `stop` was last called with; None as long as nobody has."""
        return self._stop_reason

    def plan_is_ready(self) -> bool:
        """Connected, checked, waiting for nothing but the confirmation."""
        return self._core is not None and self._core.machine.state is State.READY and not self.plan_is_confirmed

    def plan_text(self) -> str:
        """The plan for a person to agree to; complete once `plan_is_ready`."""
        return "" if self._core is None else plan_text(self._core.flight)

    @property
    def file_awaited(self) -> str | None:
        """The file whose existence the mission waits for now; the companion itself opens none."""
        return None if self._core is None else self._core.flight.file_awaited

    def file_is_there(self) -> None:
        """The file that is awaited exists."""
        if self._core is not None:
            self._core.flight.file_is_there = True

    def stop(self, reason: str) -> None:
        """End the flight: hand the vehicle to hold or land, as the mission says; done when `finished`."""
        self._stop_reason = reason
        if self._core is not None:
            self._core.stop_reason = reason

    def note(self, kind: str, text: str) -> None:
        """An event of the program around this one, told with the next step's; nothing before the first."""
        if self._core is not None:
            self._core.flight.tell(self._core.now_us, kind, text)

    def tell_computer(self, computer: ComputerStatus) -> None:
        """How this computer is, for the ground station: sent with the next step; nothing before the first."""
        if self._core is not None:
            self._core.flight.outbox.append(computer)

    @property
    def armed(self) -> bool | None:
        """As the vehicle says; None as long as it has not."""
        return None if self._core is None else self._core.flight.vehicle.armed

    @property
    def finished(self) -> bool:
        """Done or aborted, and nothing left to send."""
        return self._core is not None and self._core.machine.finished

    def status(self) -> Status:
        """For the live line."""
        if self._core is None:
            return Status(State.CONNECT.value, "", False, None, None, "off (connect)", None)
        vehicle = self._core.flight.vehicle
        latest = vehicle.history.latest()
        return Status(
            state=self._core.machine.state.value,
            vehicle_mode="" if vehicle.custom_mode is None else mode_name(vehicle.custom_mode),
            armed=vehicle.armed is True,
            position_ned_m=None if latest is None else latest.position_ned_m,
            speed_m_s=None if latest is None else math.hypot(*latest.velocity_ned_m_s),
            detector=self._core.watch.describe(),
            round_trip_us=self._core.flight.round_trip.present_us,
        )

    def obstacles(self) -> tuple[Patch, ...]:
        """What is known of the surroundings by now: from before, and from this flight's hits. Mission coordinates."""
        return self._mission.obstacles.patches() if self._core is None else all_known(self._core.flight)

    def report(self) -> FlightReport:
        """The flight so far, or the whole of it once `finished`."""
        if self._core is None:
            return FlightReport("failed", "not started", "", {}, (), None, 0, 0, None)
        core, flight = self._core, self._core.flight
        return FlightReport(
            outcome=flight.outcome or "aborted",
            reason=flight.reason or f"still in state {core.machine.state.value}",
            autopilot=flight.vehicle.autopilot_text(),
            stream_rates_hz=flight.streams.rates_hz(),
            collisions=tuple(record.report() for record in flight.collisions),
            origin_ned_m=flight.origin_ned_m,
            started_at_us=core.started_at_us,
            ended_at_us=core.now_us if flight.ended_at_us is None else flight.ended_at_us,
            armed_at_us=flight.armed_at_us,
            expectations=tuple(
                [ExpectationReport(wish.label, wish.text, wish.met, wish.detail) for wish in flight.expectations]
            ),
            obstacles=all_known(flight),
            unreachable=tuple(flight.unreachable),
            refused_messages=dict(flight.refusals.counts),
            unconfirmed=flight.unconfirmed,
            round_trip=flight.round_trip.report(),
        )
