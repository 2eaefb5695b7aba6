"""A recorded flight decided again: the same bytes at the same times through the whole companion."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from companion.companion import Companion, StepResult
from companion.report import FlightReport
from rebound_cli.replay.recording import Recording, Step
from rebound_cli.run_folder import event_line


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What became of it; `first_difference` is None when every packet sent and every event is the same to the bit."""

    report: FlightReport
    steps: int
    packets_received: int
    packets_sent: int
    events: int
    first_difference: str | None


def reproduce(recording: Recording, watch: Callable[[Companion, Step, StepResult], None]) -> Reproduction:
    """Fly the recording to its end, whatever differs. `watch` sees the companion after each step."""
    companion = Companion(recording.mission)
    comparison = _Comparison(recording.event_lines)
    for step in recording.steps:
        result = companion.step(b"".join(step.received), step.time_us)
        comparison.compare(step, result)
        watch(companion, step, result)
        if step.confirms:
            companion.confirm_plan()
        if step.stop_reason is not None:
            companion.stop(step.stop_reason)
    comparison.finish()
    return Reproduction(
        report=companion.report(),
        steps=len(recording.steps),
        packets_received=sum(len(step.received) for step in recording.steps),
        packets_sent=sum(len(step.sent) for step in recording.steps),
        events=len(recording.event_lines),
        first_difference=comparison.first_difference,
    )


class _Comparison:
    """Keeps the first difference between what was decided then and now."""

    def __init__(self, event_lines: Sequence[str]) -> None:
        self._expected = list(event_lines)
        self._count = 0
        self.first_difference: str | None = None

    def compare(self, step: Step, result: StepResult) -> None:
        for event in result.events:
            self._event(event_line(event))
        if list(step.sent) != list(result.sent_frames):
            then, now = len(step.sent), len(result.sent_frames)
            what = f"{then} packets were sent then and {now} now" if then != now else "another packet was sent"
            self._differs(f"at {step.time_us} us {what}")

    def _event(self, line: str) -> None:
        then = self._expected[self._count] if self._count < len(self._expected) else None
        self._count += 1
        if then is None:
            self._differs(f"this event is new: {line.strip()}")
        elif line != then:
            self._differs(f"event {self._count} was {then.strip()} and is {line.strip()}")

    def finish(self) -> None:
        if self._count < len(self._expected):
            self._differs(f"this event did not come again: {self._expected[self._count].strip()}")

    def _differs(self, text: str) -> None:
        if self.first_difference is None:
            self.first_difference = text
