"""A watch in flight that hears what a test says the vehicle measures: every 4 ms its IMU, every 32 ms the rest."""

from collections.abc import Callable
from dataclasses import dataclass, field

from companion.messages import Attitude, ImuSample, LandedState, LocalPosition, Odometry, Quaternion, Sample, Vector3
from companion.mission.config import CompanionConfig
from companion.reflex.detector import Situation
from companion.reflex.monitor import advance, start_monitor

STILL = (0.0, 0.0, 0.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)
IN_FLIGHT = Situation(armed=True, landed_state=LandedState.IN_AIR, height_m=3.0)
# Noise by a hair's breadth: velocities that stand still to the last digit are no estimate.
HAIR_M_S = 1e-3


@dataclass
class Watch:
    """`impacts`, `finished` and `notices`: of all that has been heard, the last with its time."""

    impacts: list = field(default_factory=list)
    finished: list = field(default_factory=list)
    told: list[tuple[int, str, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.monitor = start_monitor(CompanionConfig(detector="fused"), 0)

    def texts(self, kind: str) -> list[str]:
        return [text for _, of, text in self.told if of == kind]

    def fly(
        self,
        until_us: int,
        push: Callable[[int], Vector3] = lambda t: STILL,
        velocity: Callable[[int], Vector3] = lambda t: STILL,
        place: Callable[[int], Vector3] = lambda t: STILL,
        rates: Callable[[int], Vector3] = lambda t: STILL,
        attitude: Callable[[int], Quaternion | None] = lambda t: LEVEL,
        look: Callable[[int], None] = lambda t: None,
    ) -> "Watch":
        """`push` is what moves it beside its thrust, body m/s^2; no attitude comes where there is none."""
        for t in range(4_000, until_us, 4_000):
            x, y, z = push(t)
            samples: list[Sample] = [ImuSample(t, (x, y, z - 9.80665), rates(t))]
            if t % 32_000 == 0:
                n, e, d = velocity(t)
                told = (n + HAIR_M_S * (t // 32_000 % 2), e, d)
                samples += [Odometry(t, place(t), told, 0), LocalPosition(t, place(t), told)]
                wxyz = attitude(t)
                samples += [] if wxyz is None else [Attitude(t, wxyz, rates(t))]
            seen = advance(self.monitor, samples, IN_FLIGHT, t)
            self.impacts += seen.impacts
            self.finished += seen.finished
            self.told += [(t, notice.kind, notice.text) for notice in seen.notices]
            look(t)
        return self
