"""How an autopilot is set up, and what is said of it: an item, good, doubtful or bad, and its remedy."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum

from companion.reflex.config import MOST_HELD_S, EstimateConfig


@dataclass(frozen=True, slots=True)
class SerialLine:
    """What the link goes through. `baud` None: the vehicle's own USB port, which has none."""

    baud: int | None
    latency_timer_ms: int | None = None  # of the converter's driver, where it has one


@dataclass(frozen=True, slots=True)
class Setup:
    """What an autopilot's parameters, and the smallest hit that the samples of the IMU show, are judged by."""

    parameters: Mapping[str, int | float]
    line: SerialLine | None
    vehicle_type: str
    estimate: EstimateConfig
    imu_hz: float
    threshold_m_s2: float
    false_alarms: str  # by noise, for people


class Verdict(Enum):
    GOOD = "ok"
    DOUBTFUL = "look"
    BAD = "no"


@dataclass(frozen=True, slots=True)
class PreflightItem:
    """`fix` is a parameter and the value that mends it; None where only a person can."""

    item: str
    verdict: Verdict
    found: str
    remedy: str = ""
    fix: tuple[str, int | float] | None = None


def judged(
    item: str,
    found: str,
    is_off: bool = False,
    remedy: str = "",
    is_bad: bool = False,
    mended: float | None = None,
    beyond: str = "",
) -> PreflightItem:
    """Good, or with its remedy doubtful where `is_off`, bad where `is_bad`. `mended`: the parameter's value that mends
    it. `beyond` is added to what was found where it is not good.
    """
    if not (is_off or is_bad):
        return PreflightItem(item, Verdict.GOOD, found)
    verdict = Verdict.BAD if is_bad else Verdict.DOUBTFUL
    return PreflightItem(item, verdict, found + beyond, remedy, None if mended is None else (item, mended))


def judged_settings(
    settings: Mapping[str, Callable[[str, float, Setup], PreflightItem]], setup: Setup
) -> Iterator[PreflightItem]:
    """An item for each parameter, by its own judge; one that was not told is doubtful."""
    for name, judge in settings.items():
        value = setup.parameters.get(name)
        unread = judged(name, "the vehicle did not tell it", True, "ask again over a better link")
        yield unread if value is None else judge(name, value, setup)


def judged_loss(name: str, loss_s: float, found: str, cost: str = "") -> PreflightItem:
    """For how long the last attitude is flown on. `cost`: of less, for people."""
    remedy = f"{name} = {MOST_HELD_S:g}, or recoveries are flown by position alone{cost}"
    beyond = f"; an attitude is safe to hold {MOST_HELD_S:g} s"
    return judged(name, found, round(loss_s, 3) > MOST_HELD_S, remedy, mended=MOST_HELD_S, beyond=beyond)
