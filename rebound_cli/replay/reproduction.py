"""A recorded flight decided again: the same bytes at the same times through the whole companion."""

from collections.abc import Sequence
from dataclasses import dataclass

from companion.companion import Companion, StepResult
from companion.detection.interface import Situation
from companion.guard.config import GuardConfig
from companion.guard.guard import Guard
from rebound_cli.replay.findings import Findings, Notebook
from rebound_cli.replay.recording import Recording, Step
from rebound_cli.run_folder import event_line

_BEFORE_THE_FIRST_STEP = Situation(off_reason="connect")


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What became of it; `first_difference` is None when every packet sent and every event is the same to the bit."""

    findings: Findings
    steps: int
    packets_received: int
    packets_sent: int
    events: int
    is_cut: bool
    first_difference: str | None


def reproduce(recording: Recording) -> Reproduction:
    """Fly the recording to its end, whatever differs."""
    settings = recording.settings
    stepped = Guard(settings) if isinstance(settings, GuardConfig) else Companion(settings)
    comparison = _Comparison(recording.event_lines)
    notebook = Notebook()
    for step in recording.steps:
        # What the flight knew when the packets came; they may move it on.
        known = _known(stepped)
        result = stepped.step(b"".join(step.received), step.time_us)
        comparison.compare(step, result)
        for event in result.events:
            notebook.tell(event.time_us, event.text)
        assert stepped.core is not None, "the first step begins it"
        notebook.note(stepped.core.watch, known, step.time_us)
        if isinstance(stepped, Companion):
            if step.confirms:
                stepped.confirm_plan()
            if step.file_appears:
                stepped.file_is_there()
        if step.stop_reason is not None:
            stepped.stop(step.stop_reason)
        if step.computer is not None:
            stepped.tell_computer(step.computer)
        for kind, text in step.notes:
            stepped.note(kind, text)
    comparison.finish()
    return Reproduction(
        findings=notebook.close(recording.steps[-1].time_us),
        steps=len(recording.steps),
        packets_received=sum(len(step.received) for step in recording.steps),
        packets_sent=sum(len(step.sent) for step in recording.steps),
        events=len(recording.event_lines),
        is_cut=recording.is_cut,
        first_difference=comparison.first_difference,
    )


def _known(stepped: Companion | Guard) -> Situation:
    return _BEFORE_THE_FIRST_STEP if stepped.core is None else stepped.core.situation()


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
