"""Which hits were missed, and which alarms false, by airframe, rate of the IMU and speed."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from scipy.stats import beta

from bench.campaign.plan import Json
from bench.detectors.vehicles import AIRFRAMES
from bench.detectors_report.numbers import per_cent, percentile, text_of
from bench.hits.flight import APPROACHES, FREE_FLIGHT_S, IMU_HZ, MOST_RECOVERY_S, OVERTURNED_DEG, FlownHit

# Into the surface. The detectors' bars begin at 0.5 m/s.
BANDS_M_S = ((0.0, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 5.0))
# Of hits missed, and of false alarms: three hundred hits without one show it.
BOUND, CONFIDENCE = 0.01, 0.95
NAMED_SEEDS = 12
_COLUMNS = (
    *("hits", "missed", "at most", "false alarms", "at most"),
    *("again", "not at rest", "over", "tilt", "lost", "at rest after"),
)


@dataclass(frozen=True, slots=True)
class Flown:
    """Cases with their results, in the order of seeds."""

    cases: Sequence[FlownHit]
    results: Mapping[int, Json]

    def hits(self, which: Callable[[FlownHit, Json], bool]) -> list[Json]:
        touched = ((self.cases[number], one) for number, one in self.results.items() if one["touched"])
        return [one for case, one in touched if which(case, one)]


def lead(flown: Flown) -> Iterator[str]:
    everyone = flown.results.values()
    hits, hours = flown.hits(lambda case, one: True), sum(one["seconds"] for one in everyone) / 3600.0
    yield f"{len(everyone)} approaches with {len(hits)} hits, {hours:.1f} h in the vehicle's time. {missed(hits)} hits"
    yield f"were missed, {sum(one['false'] for one in everyone)} alarms were false. Each vehicle begins in flight,"
    yield f"{FREE_FLIGHT_S[0]} to {FREE_FLIGHT_S[1]} s before its hit, and is guarded over the wire until it rests, for"
    yield f"{MOST_RECOVERY_S:g} s at most. The simulator's truth judges."
    yield ""


def missed(hits: Sequence[Json]) -> int:
    return sum(not one["found"] for one in hits)


def at_most(events: float, of: float) -> float:
    """The share that is not exceeded with the confidence, by Clopper and Pearson."""
    return float(beta.ppf(CONFIDENCE, events + 1, of - events)) if events < of else 1.0


def cells(flown: Flown) -> Iterator[str]:
    yield from head("airframe, IMU", "speed, m/s", *_COLUMNS)
    open_cells = []
    for airframe in AIRFRAMES:
        for imu_hz in IMU_HZ:
            for low_m_s, high_m_s in BANDS_M_S:
                hits = flown.hits(
                    lambda case, one, of=(airframe, imu_hz), low=low_m_s, high=high_m_s: (  # type: ignore[misc]
                        (case.hit.airframe, case.imu_hz) == of and low <= one["closing_m_s"] < high
                    )
                )
                name, speed = f"{airframe}, {imu_hz} Hz", f"{low_m_s:g} to {high_m_s:g}"
                row, is_shown = _cell(hits)
                yield f"| {name} | {speed} | {row} |"
                open_cells += [] if is_shown else [f"{name}, {speed} m/s"]
    noticed_m_s = BANDS_M_S[1][0]
    row, _ = _cell(flown.hits(lambda case, one: one["closing_m_s"] >= noticed_m_s))
    yield f"| all | from {noticed_m_s:g} on | {row} |"
    yield ""
    yield f"At most: with a confidence of {100 * CONFIDENCE:g} %, by Clopper and Pearson. Speeds are those into the"
    yield "surface. Again: the vehicle came back and touched again. Over: it leant beyond 90°. Tilt and height lost:"
    yield "95 % of the hits have less. At rest after: median."
    yield ""
    yield f"Not shown to miss fewer than {100 * BOUND:g} % with fewer than {100 * BOUND:g} % of false alarms:"
    yield f"{'; '.join(open_cells) or 'none'}."
    yield ""


def approaches(flown: Flown) -> Iterator[str]:
    yield from head("what was met", *_COLUMNS)
    for approach in APPROACHES:
        hits = flown.hits(lambda case, one, of=approach: case.hit.approach == of)  # type: ignore[misc]
        yield f"| {approach} | {_cell(hits)[0]} |"
    yield ""


def head(*columns: str) -> Iterator[str]:
    yield f"| {' | '.join(columns)} |"
    yield "|---" * len(columns) + "|"


def _cell(hits: Sequence[Json]) -> tuple[str, bool]:
    """The rest of its row, and whether both shares are shown to be below the bound."""
    found = [one for one in hits if one["found"]]
    rests = [one["rest_s"] for one in found if one["rest_s"] is not None]
    events = missed(hits), sum(one["false"] > 0 for one in hits)
    bounds = [at_most(some, len(hits)) for some in events]
    shares = [
        text for some, bound in zip(events, bounds, strict=True) for text in (str(some), f"{per_cent(bound, 2)} %")
    ]
    return " | ".join(
        [
            str(len(hits)),
            *shares,
            str(sum(one["again"] > 0 for one in found)),
            str(len(found) - len(rests)),
            str(sum(one["tilt_deg"] > OVERTURNED_DEG for one in hits)),
            f"{text_of(percentile([one['tilt_deg'] for one in hits], 95), 0)}°",
            f"{text_of(percentile([one['lost_m'] for one in hits], 95), 2)} m",
            f"{text_of(percentile(rests, 50), 2)} s",
        ]
    ), max(bounds) < BOUND


def seeds(flown: Flown) -> Iterator[str]:
    """Of hits to look at again."""
    kinds: tuple[tuple[str, Callable[[Json], bool]], ...] = (
        ("Missed at 0.5 m/s and more", lambda one: not one["found"] and one["closing_m_s"] >= BANDS_M_S[1][0]),
        ("Over", lambda one: one["tilt_deg"] > OVERTURNED_DEG),
        ("With a false alarm", lambda one: one["false"] > 0),
    )
    for what, is_one in kinds:
        found = [flown.cases[number].hit for number, one in flown.results.items() if one["touched"] and is_one(one)]
        named = ", ".join(f"{hit.seed} ({hit.approach})" for hit in found[:NAMED_SEEDS])
        if found:
            yield f"- {what}: {len(found)}, by seed {named}{', ...' if len(found) > NAMED_SEEDS else ''}."
    yield ""
