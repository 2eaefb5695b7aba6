"""Tables of the healthy flights, simulated and recorded, and of recorded impacts in recorded flights."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bench.detectors.flights import FlightCase
from bench.detectors.recorded import RECORDED_RATES, SCALES, STRIKE_LOG, STRIKE_S, HealthyCase, InjectedCase
from bench.detectors.watching import ASKED_HZ
from bench.detectors_report.bars import Bar
from bench.detectors_report.hits import DEFAULT
from bench.detectors_report.numbers import Entry, per_cent, percentile, share, text_of
from bench.paper.table import markdown

# What must be shown.
HOURS_BAR = 10.0
INJECTED_BARS = {"200": 0.995, "50": 0.95}
LANDING_PHASES = frozenset({"landing", "landed"})


@dataclass(frozen=True, slots=True)
class Alarms:
    """What one detector reported in all the flights that it heard at one rate."""

    hours: float
    flights: int
    phases: Sequence[str]
    touches: int

    @property
    def in_air(self) -> int:
        return sum(phase not in LANDING_PHASES for phase in self.phases)


def alarms(
    cases: Sequence[FlightCase], results: Mapping[int, Entry], detector: str, rate: int, family: str | None = None
) -> Alarms:
    seconds, flights, touches = 0.0, 0, 0
    phases: list[str] = []
    for number, flight in results.items():
        case = cases[number]
        if detector not in case.detectors or (family is not None and case.family != family):
            continue
        entry = flight["rates"][str(rate)][detector]
        seconds, flights, touches = seconds + flight["seconds"], flights + 1, touches + entry["touches"]
        phases += [phase for _, phase, _ in entry["alarms"]]
    return Alarms(seconds / 3600.0, flights, phases, touches)


def flight_bars(cases: Sequence[FlightCase], results: Mapping[int, Entry]) -> list[Bar]:
    bars = []
    for rate in ASKED_HZ:
        told = alarms(cases, results, DEFAULT, rate)
        bars.append(
            Bar(
                f"{rate} Hz: false alarms in simulated flights, landings included",
                f"none in {HOURS_BAR:g} h",
                f"{len(told.phases)} in {told.hours:.1f} h",
                # Fewer hours without an alarm prove nothing yet; an alarm does.
                False if told.phases else True if told.hours >= HOURS_BAR else None,
                f"{told.flights} flights",
            )
        )
    return bars


def alarms_text(cases: Sequence[FlightCase], results: Mapping[int, Entry]) -> str:
    """Every detector's false alarms an hour."""
    rows = []
    for detector in max((case.detectors for case in cases), key=len):
        for rate in ASKED_HZ:
            told = alarms(cases, results, detector, rate)
            if told.hours == 0.0:
                continue
            worst = ", ".join(f"{phase} {count}" for phase, count in Counter(told.phases).most_common(4))
            rows.append(
                [
                    detector,
                    f"{rate}",
                    f"{told.hours:.1f}",
                    f"{len(told.phases)}",
                    f"{len(told.phases) / told.hours:.2f}",
                    f"{told.in_air / told.hours:.2f}",
                    f"{told.touches}",
                    worst,
                ]
            )
    columns = (
        "detector",
        "Hz",
        "hours",
        "false alarms",
        "per hour",
        "per hour, landings aside",
        "touches told as such",
        "most often in",
    )
    return markdown(columns, rows)


def families_text(cases: Sequence[FlightCase], results: Mapping[int, Entry]) -> str:
    """The default detector by what the flights were like."""
    rows = []
    for family in dict.fromkeys(case.family for case in cases):
        by_rate = [alarms(cases, results, DEFAULT, rate, family) for rate in ASKED_HZ]
        if not by_rate[0].flights:
            continue
        worst = ", ".join(
            f"{phase} {count}" for phase, count in Counter(p for a in by_rate for p in a.phases).most_common(3)
        )
        rows.append([family, f"{by_rate[0].hours:.1f}", *[f"{len(told.phases)}" for told in by_rate], worst])
    return markdown(("flights", "hours", *[f"alarms at {rate} Hz" for rate in ASKED_HZ], "in"), rows)


# --- recorded ---------------------------------------------------------------------------------------------------------


def recorded_bars(cases: Sequence[HealthyCase], results: Mapping[int, Entry]) -> list[Bar]:
    bars = []
    for rate in RECORDED_RATES:
        told = [e for n, e in _of_default(results, rate) if cases[n].log != STRIKE_LOG and cases[n].scale == 1.0]
        count = sum(len(entry["collisions"]) for entry in told)
        name = "as recorded" if RECORDED_RATES[rate] is None else f"{rate} Hz"
        bars.append(
            Bar(f"{name}: false alarms in real flights", "none", f"{count}", count == 0, f"{len(told)} logs of flights")
        )
    return bars + [_strike_bar(cases, results, scale) for scale in SCALES]


def _strike_bar(cases: Sequence[HealthyCase], results: Mapping[int, Entry], scale: float) -> Bar:
    """The strike is judged at the recorded rate, as few samples of it are left at the lower ones; landings at all."""
    found: list[str] = []
    false = landings = 0
    for rate in RECORDED_RATES:
        for number, entry in _of_default(results, rate):
            if cases[number].scale != scale:
                continue
            if cases[number].log == STRIKE_LOG:
                if any(STRIKE_S[0] <= at_s <= STRIKE_S[1] for at_s, _ in entry["collisions"]):
                    found.append(rate)
            else:
                false += len(entry["collisions"])
                landings += sum(kind == "landing" for _, kind in entry["touches"])
    name = {0.5: "halved", 1.0: "as they are", 2.0: "doubled"}[scale]
    return Bar(
        f"real flights, magnitudes {name}: ground strike found, landings told from it",
        "found, no landing taken for a strike",
        f"strike found at {', '.join(found) or 'no'} Hz; {false} landings or manoeuvres taken for a collision, "
        f"{landings} told as landings",
        next(iter(RECORDED_RATES)) in found and false == 0,
        f"{len(RECORDED_RATES)} rates",
    )


def _of_default(results: Mapping[int, Entry], rate: str) -> list[tuple[int, Entry]]:
    return [
        (number, flight["rates"][rate][DEFAULT])
        for number, flight in results.items()
        if DEFAULT in flight["rates"][rate]
    ]


def recorded_text(cases: Sequence[HealthyCase], results: Mapping[int, Entry]) -> str:
    """Every detector on every recorded flight as it is."""
    rows = []
    for number, flight in results.items():
        if cases[number].scale != 1.0:
            continue
        for detector in cases[number].detectors:
            cells = []
            for rate in RECORDED_RATES:
                entry = flight["rates"][rate][detector]
                times = ", ".join(f"{at_s:.2f}" for at_s, _ in entry["collisions"][:4])
                more = len(entry["collisions"]) - 4
                cells.append((times + (f" and {more} more" if more > 0 else "")) or "none")
            rows.append([cases[number].log.removesuffix(".ulg"), detector, f"{flight['seconds']:.0f}", *cells])
    head = ["as recorded" if asked is None else f"{rate} Hz" for rate, asked in RECORDED_RATES.items()]
    return markdown(("log", "detector", "length [s]", *[f"collisions at [s], {name}" for name in head]), rows, left=6)


def injected_bars(cases: Sequence[InjectedCase], results: Mapping[int, Entry]) -> list[Bar]:
    bars = []
    for rate in RECORDED_RATES:
        entries = injected(cases, results, DEFAULT, rate)
        if not entries:
            continue
        found = share("latency_ms" in entry for entry in entries)
        bar = INJECTED_BARS.get(rate)
        bars.append(
            Bar(
                f"semi-synthetic (recorded impacts in recorded flights), {rate} Hz",
                "apart" if bar is None else f"≥ {100 * bar:g} %",
                f"{per_cent(found, 2)} %",
                None if bar is None else found >= bar,
                f"{len(entries)} hits, {sum(entry['false'] for entry in entries)} false alarms before them",
            )
        )
    return bars


def injected(cases: Sequence[InjectedCase], results: Mapping[int, Entry], detector: str, rate: str) -> list[Any]:
    return [hit["rates"][rate][detector] for number, hit in results.items() if detector in cases[number].detectors]


def injected_text(cases: Sequence[InjectedCase], results: Mapping[int, Entry]) -> str:
    rows = []
    for detector in max((case.detectors for case in cases), key=len):
        for rate in RECORDED_RATES:
            entries = injected(cases, results, detector, rate)
            late = [entry["latency_ms"] for entry in entries if "latency_ms" in entry]
            rows.append(
                [
                    detector,
                    rate,
                    f"{len(entries)}",
                    per_cent(share("latency_ms" in entry for entry in entries), 2),
                    f"{text_of(percentile(late, 50))} / {text_of(percentile(late, 99))}",
                    f"{sum(entry['false'] for entry in entries)}",
                ]
            )
    columns = ("detector", "Hz", "hits", "found [%]", "latency, median / 99 % [ms]", "false before the hit")
    return markdown(columns, rows)
