"""Whether what the companion did, event by event, is what docs/how-to/missions.md says follows from the mission."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from bench.random_missions.flight import JudgedFlight
from companion.mission.items import Step, program
from companion.mission.model import Mission
from companion.mission.policy import OnCollision
from companion.report import Event, FlightReport

# To these there may be another way; a detour of anything else is over with the hit.
_WITH_A_GOAL = ("go_to", "path", "orbit")


@dataclass(slots=True)
class _Course:
    """Where in the mission the flight is, by the rules alone."""

    mission: Mission
    steps: tuple[Step, ...]
    index: int = 0
    hits: int = 0
    hits_of_step: int = 0
    going_home: bool = False
    is_landing: bool = False
    due: str | None = None
    """What the latest hit's policy says follows the recovery, or the mission of a goal out of reach."""
    held: bool = False
    was_held: bool = False
    """Before the latest hit."""
    complaints: list[str] = field(default_factory=list)

    def policy(self) -> tuple[OnCollision, int]:
        own = self.steps[self.index].item.on_collision
        return (self.mission.on_collision, self.hits) if own is None else (own, self.hits_of_step)

    def take(self, event: Event) -> None:
        match event.kind:
            case "detection":
                self._hit()
            case "unconfirmed":
                self._take_back()
            case "unreachable":
                # Home has no item to go on with: the vehicle lands where it is.
                is_home = "then" not in event.data
                if is_home:
                    self.going_home = True
                self.due = "land" if is_home else str(event.data["then"])
            case "hold":
                self._expect(self.due == "hold", "held")
                self.held = True
            case "item":
                self._item(int(str(event.data["step"])))
            case "return":
                is_item = self.steps[self.index].name == "return"
                on_way = self.going_home and self.due in (None, "return")
                self._expect(self.due == "return" or (self.due is None and is_item) or on_way, "returned")
                self.going_home, self.due = True, None
            case "landing":
                is_item = self.steps[self.index].name == "land" or self.going_home
                self._expect(self.due == "land" or (self.due is None and is_item), "landed")
                self.due, self.is_landing = None, True

    def _take_back(self) -> None:
        """A detection that nothing confirms is no hit: the flight goes on where it was."""
        self.hits -= 1
        self.hits_of_step -= 1
        if self.is_landing:
            self.due = "land"
        elif self.going_home:
            self.due = "return"
        elif self.was_held:
            self.due = "hold"
        else:
            self.due = "continue" if self.index == 0 else "retry"

    def _hit(self) -> None:
        self.was_held = self.held
        self.hits += 1
        self.hits_of_step += 1
        self.held = False
        policy, hits = self.policy()
        if self.is_landing:
            # On the way down there is nothing else to go on with.
            self.due = "land"
        elif hits >= policy.max_hits:
            self.due = "land" if self.going_home else policy.after_max_hits
        else:
            self.due = "return" if self.going_home else policy.then

    def _item(self, step: int) -> None:
        again = self.index if self.steps[self.index].name in _WITH_A_GOAL else self.index + 1
        held = self.index + 1 if self.held else -1
        after = {"continue": self.index + 1, "hold": held, "retry": self.index, "detour": again}
        wanted = self.index + 1 if self.due is None else after.get(self.due, -1)
        self._expect(step == wanted, f"began step {step}")
        if step != self.index:
            self.hits_of_step = 0
        self.index, self.due, self.held = step, None, False

    def _expect(self, is_so: bool, what: str) -> None:
        if not is_so:
            instead = self.due or "to go on"
            self.complaints.append(f"{what} at step {self.index} instead of: {instead}")


def disobediences(flight: JudgedFlight) -> list[str]:
    """In words; empty where everything followed from the mission."""
    course = _Course(flight.mission, program(flight.mission.items))
    for event in flight.events:
        course.take(event)
    return [*course.complaints, *_ending(course, flight.report)]


def _ending(course: _Course, report: FlightReport) -> Iterator[str]:
    wanted = "aborted" if course.due == "abort" else "completed"
    if report.outcome != wanted:
        yield f"{report.outcome} instead of {wanted}: {report.reason}"
