"""The guard as a step function: bytes and the time in, bytes and events out."""

import math

from companion.companion import StepResult
from companion.guard.config import GuardConfig
from companion.guard.core import GuardCore, advance, fault, next_deadline_us, start
from companion.guard.states import State
from companion.mavlink.decode import LONE_GUARD_CONVERTERS, Decoder
from companion.mavlink.encode import Encoder
from companion.messages import ComputerStatus
from companion.px4_mode import mode_name
from companion.report import CollisionReport, RoundTripReport, Status


class Guard:
    """Joins the codec with the pure core; holds no clock and no socket. Times are microseconds, any epoch.

    On a link of its own: what others send to the vehicle does not pass through here.
    """

    def __init__(self, config: GuardConfig) -> None:
        self._config = config
        self._decoder = Decoder(LONE_GUARD_CONVERTERS)
        self._encoder = Encoder()
        self._addressed = False
        self._core: GuardCore | None = None
        self._stop_reason: str | None = None

    def step(self, received: bytes, now_us: int) -> StepResult:
        """Call with the bytes received since the last call, or b"" when only time has passed."""
        core = self._core or self._begin(now_us)
        frames = self._decoder.feed(received) if received else []
        samples = [sample for _, sample in frames if sample is not None]
        outputs = advance(core, samples, now_us)
        identity = core.flight.vehicle.identity
        if identity is not None and not self._addressed:
            self._addressed = True
            self._decoder.listen_to(identity.system_id, identity.component_id)
            self._encoder.speak_to(identity.system_id, identity.component_id)
        sent = self._encoder.all_packets(outputs.messages, lambda error: fault(core, error, now_us))
        return StepResult(tuple([frame for frame, _ in frames]), sent, outputs.events)

    def _begin(self, now_us: int) -> GuardCore:
        self._core = core = start(self._config, False, now_us)
        core.stop_reason = self._stop_reason
        return core

    def next_deadline_us(self) -> int:
        """When `step(b"", now)` is due if nothing arrives before."""
        return 0 if self._core is None else next_deadline_us(self._core)

    def enable(self) -> None:
        """Watch again after the guard has stood down."""
        if self._core is not None:
            self._core.is_enabled = True

    def stop(self, reason: str) -> None:
        """End: what is held is given back to hold first; done when `finished`."""
        self._stop_reason = reason
        if self._core is not None:
            self._core.stop_reason = reason

    @property
    def core(self) -> GuardCore | None:
        """What is remembered between steps, for whoever studies a guard; None before the first."""
        return self._core

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
        return self._core is not None and self._core.machine.state is State.ENDED

    @property
    def outcome(self) -> str:
        """Why it ended."""
        return "" if self._core is None else self._core.machine.outcome

    @property
    def state(self) -> State:
        return State.CONNECTING if self._core is None else self._core.machine.state

    def status(self) -> Status:
        """For the live line."""
        return (
            Status(State.CONNECTING.value, "", False, None, None, "off", None)
            if self._core is None
            else status(self._core)
        )

    def collisions(self) -> tuple[CollisionReport, ...]:
        return () if self._core is None else collisions(self._core)

    def left_alone(self) -> int:
        """Hits that were told and left to the program that flies."""
        return 0 if self._core is None else self._core.guard.left_alone

    def round_trip(self) -> RoundTripReport:
        return RoundTripReport() if self._core is None else self._core.flight.round_trip.report()

    @property
    def stop_reason(self) -> str | None:
        """What `stop` was last called with; None as long as nobody has."""
        return self._stop_reason


def status(core: GuardCore) -> Status:
    vehicle = core.flight.vehicle
    latest = vehicle.history.latest()
    return Status(
        state=core.machine.state.value,
        vehicle_mode="" if vehicle.custom_mode is None else mode_name(vehicle.custom_mode),
        armed=vehicle.armed is True,
        position_ned_m=None if latest is None else latest.position_ned_m,
        speed_m_s=None if latest is None else math.hypot(*latest.velocity_ned_m_s),
        detector=core.watch.describe(),
        round_trip_us=core.flight.round_trip.present_us,
    )


def collisions(core: GuardCore) -> tuple[CollisionReport, ...]:
    return tuple(record.report() for record in core.flight.collisions)
