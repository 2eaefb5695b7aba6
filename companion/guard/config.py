"""A guard's settings: every key optional, every default with its reason."""

from typing import Annotated, Literal

from pydantic import Field, field_validator

from companion.autopilot.known import GUARDED_MODES, MODE_NAMES, NAMES
from companion.fence import Fence
from companion.mission.config import CompanionConfig
from companion.mission.model import Mission
from companion.mission.policy import SetpointLimits
from companion.reflex.config import RecoveryConfig
from companion.strict_model import Positive, StrictModel


class GuardConfig(StrictModel):
    """The file of `rebound guard --config`; a mission's parts of the same name mean the same."""

    retired = frozenset({"beside_program"})

    modes: Annotated[tuple[str, ...], Field(min_length=1)] = GUARDED_MODES
    """Modes that the guard may take over."""
    then: Literal["previous", "hold"] = "hold"
    """What the vehicle is given back to. hold: what flew into the wall does not do it again unless somebody says so."""
    on_crash: Literal["tell", "disarm"] = "tell"
    """When the vehicle lies on the ground after a crash: whose vehicle it is decides. Never in the air."""
    max_hits: Annotated[int, Field(strict=True, ge=1)] = 3
    """Of one flight; after this one the vehicle is given back to hold, whatever `then` says. Three hits in one
    flight are no accident."""
    between: tuple[str, ...] = ()
    """Where programs reach the vehicle through the guard, e.g. udpin://0.0.0.0:14540. While the guard recovers it, what
    would move it is kept out (see moves.py)."""
    confirm_within_s: Annotated[Positive, Field(ge=0.2)] = 1.0
    """How long OFFBOARD may take; then the vehicle is asked to hold. The answer takes 10 ms, CURRENT_MODE at 10 Hz 100
    ms; a command lost on the way is repeated after 500 ms."""
    lead_hz: Annotated[Positive, Field(ge=2.0, le=50.0)] = 10.0
    """Rate of setpoints before there is a hit. PX4 wants 2 Hz before it takes OFFBOARD; five times that
    survives lost packets."""
    fence: Fence = Fence(radius_m=100_000.0, max_height_m=10_000.0)
    """Where recoveries may lead. From where the vehicle was armed. Nobody knows a stranger's field: as good as none
    until it is given."""
    limits: SetpointLimits = SetpointLimits()
    """What no setpoint exceeds."""
    recovery: RecoveryConfig = RecoveryConfig()
    """How a recovery is planned."""
    companion: CompanionConfig = CompanionConfig()
    """Detection, estimate, streams and link."""

    @field_validator("modes")
    @classmethod
    def _known_modes(cls, modes: tuple[str, ...]) -> tuple[str, ...]:
        for mode in modes:
            if mode not in MODE_NAMES:
                raise ValueError(f"{mode!r} is no mode of {NAMES}: choose from {', '.join(sorted(MODE_NAMES))}")
        return modes

    def as_mission(self) -> Mission:
        """What the parts that the guard shares with a flight read: a mission of which nothing is ever flown."""
        shared = {part: getattr(self, part) for part in Mission.model_fields if part in GuardConfig.model_fields}
        return Mission.model_construct(name="guard", items=(), **shared)
