"""The companion as a step function: bytes and the time in, bytes and events out."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any, Generic, NamedTuple, TypeVar

from companion.autopilot.known import ASSUMED
from companion.flight.core import Core
from companion.flight.machine import FlightCore
from companion.flight.obstacle_map import all_known
from companion.flight.plan import plan_text
from companion.flight.rehearsal import rehearsed
from companion.flight.states import State
from companion.mavlink.decode import Decoder
from companion.mavlink.encode import Encoder
from companion.mavlink.readers import READERS, Reader
from companion.memory.patch import Patch
from companion.messages import ComputerStatus, Outgoing, Sample
from companion.mission.model import Mission
from companion.report import Event, FlightReport, Status


class StepResult(NamedTuple):
    """Packets and events. A tuple, as one is made in every step. `received_frames` are in order; bytes of no packet are
    `Stray`. An incomplete packet appears in the step that completes it.
    """

    received_frames: tuple[bytes, ...]
    sent_frames: tuple[bytes, ...]
    events: tuple[Event, ...]


CoreT = TypeVar("CoreT", bound=Core[Any])


class Stepped(ABC, Generic[CoreT]):
    """Joins the codec with a pure core; holds no clock and no socket. Times are microseconds, any epoch."""

    def __init__(self, core: CoreT, readers: Mapping[int, Reader] = READERS) -> None:
        self.core = core
        self._decoder, self._encoder = Decoder(readers), Encoder()
        self._has_begun = self._is_addressed = False

    @abstractmethod
    def _rehearsed(self) -> Iterable[Outgoing]:
        """What another one like this sends at a hit."""

    def rehearse(self) -> None:
        """Walk the way of a hit once, before the flight, in which nothing changes by that but how soon the first hit is
        answered.
        """
        encoder = Encoder()
        # Whatever fails in it keeps no vehicle from being guarded.
        with suppress(Exception):
            for message in self._rehearsed():
                encoder.packets(message)

    def step(self, received: bytes, now_us: int) -> StepResult:
        """Take the bytes received since the last call, or b"" when only time has passed."""
        core = self.core
        if not self._has_begun:
            self._has_begun = True
            core.begin(now_us)
        frames: list[bytes] = []
        samples: list[Sample] = []
        for frame, sample in self._decoder.feed(received) if received else ():
            frames.append(frame)
            if sample is not None:
                samples.append(sample)
        # Most of what a vehicle sends is for others, and shows nothing.
        messages, events = core.advance(samples, now_us) if samples or core.is_due(now_us) else ([], [])
        identity = core.flight.vehicle.identity
        if identity is not None and not self._is_addressed:
            # From now on the vehicle alone is listened to and spoken to.
            self._is_addressed = True
            self._decoder.listen_to(identity.system_id, identity.component_id, identity.autopilot)
            self._encoder.speak_to(identity.system_id, identity.component_id, identity.autopilot)
        sent: list[bytes] = []
        for message in messages:
            # What cannot be packed is left out.
            try:
                sent += self._encoder.packets(message)
            except Exception as error:
                core.fault(error, now_us)
        return StepResult(tuple(frames), tuple(sent), tuple(events))

    def last_words(self) -> list[tuple[float, bytes]]:
        """What the vehicle has to be told if this program dies now, each so many seconds later."""
        words = self.core.last_words
        packets = {word: self._encoder.unsent(word) for word in {word for _, word in words}}
        return [(later_s, packets[word]) for later_s, word in words]

    def next_deadline_us(self) -> int:
        """When `step(b"", now)` is due if nothing arrives before; in the past when it is due at once."""
        return self.core.next_deadline_us()

    def stop(self, reason: str) -> None:
        """End the flight: a vehicle under control is handed to hold or land first, one that recovers from a hit once it
        is clear or when this is called again. Done when `finished`.
        """
        self.core.stop_reason = reason

    @property
    def stop_is_put_off(self) -> bool:
        """Whether that `stop` waits until the vehicle is clear of what it has hit; another does not."""
        return self.core.flight.stop_put_off is not None

    def note(self, kind: str, text: str) -> None:
        """Add an event of the surrounding program to the next step."""
        self.core.flight.report(self.core.now_us, kind, text)

    def tell_computer(self, computer: ComputerStatus) -> None:
        """Send this computer's load to the ground station with the next step."""
        self.core.flight.outbox.append(computer)

    @property
    def armed(self) -> bool | None:
        """Whether the vehicle reports that it is armed; None before its first report."""
        is_armed: bool | None = self.core.flight.vehicle.armed
        return is_armed

    @property
    def finished(self) -> bool:
        """Ended, and nothing left to send."""
        return self.core.finished

    def status(self) -> Status:
        """For the live line."""
        core, vehicle = self.core, self.core.flight.vehicle
        latest = vehicle.history.latest
        return Status(
            state=core.state.value,
            vehicle_mode=vehicle.mode_name,
            armed=vehicle.armed is True,
            position_ned_m=None if latest is None else latest.position_ned_m,
            speed_m_s=None if latest is None else math.hypot(*latest.velocity_ned_m_s),
            detector=core.reflex.monitor.describe(),
            round_trip_us=core.flight.round_trip.present_us,
        )


_REHEARSAL = {"name": "rehearsal", "items": [{"takeoff": {"height_m": 1.5}}, {"land": {}}]}


class Companion(Stepped[FlightCore]):
    """Of one flight of a mission."""

    def __init__(self, mission: Mission) -> None:
        super().__init__(FlightCore(mission))

    def _rehearsed(self) -> Iterable[Outgoing]:
        # No mission's own policy or fence ends it before the hit.
        return rehearsed(FlightCore(Mission.model_validate(_REHEARSAL)), State.HOLDING, ASSUMED.setpoints)

    def confirm_plan(self) -> None:
        """Confirm the plan, also before the first step."""
        self.core.flight.plan_confirmed = True

    def plan_is_ready(self) -> bool:
        """Connected, checked, waiting for nothing but the confirmation."""
        return self.core.state is State.READY and not self.core.flight.plan_confirmed

    def plan_text(self) -> str:
        """The plan for a person to agree to; complete once `plan_is_ready`."""
        return plan_text(self.core.flight)

    def file_is_there(self) -> None:
        """The file that the mission awaits exists; the companion itself opens none."""
        self.core.flight.file_awaited = None

    def obstacles(self) -> tuple[Patch, ...]:
        """What is known of the surroundings by now: from before, and from this flight's hits. Mission coordinates."""
        return all_known(self.core.flight).patches

    def report(self) -> FlightReport:
        """The flight so far, or the whole of it once `finished`."""
        core, flight = self.core, self.core.flight
        return FlightReport(
            outcome=flight.outcome or "aborted",
            reason=flight.reason or f"still in state {core.state.value}",
            autopilot=flight.vehicle.autopilot_text(),
            stream_rates_hz=flight.streams.rates_hz(),
            collisions=core.collisions(),
            origin_ned_m=flight.origin_ned_m,
            started_at_us=core.started_at_us,
            ended_at_us=core.now_us,
            armed_at_us=flight.armed_at_us,
            expectations=tuple([wish.report for wish in flight.expectations]),
            obstacles=all_known(flight).patches,
            unreachable=tuple(flight.unreachable),
            refused_messages=dict(flight.refusals.counts),
            unconfirmed=flight.unconfirmed,
            round_trip_ms=flight.round_trip.summary_ms(),
            promise=core.reflex.monitor.promise,
            crashed=flight.crashed,
        )
