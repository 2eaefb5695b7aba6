"""Pictures of the bench: who finds what at which price, at which speed, how soon."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from bench.detectors.flights import SWEPT_RATE, FlightCase
from bench.detectors.scoring import SWEPT_RATES
from bench.detectors.vehicles import AIRFRAMES
from bench.detectors.watching import ASKED_HZ, SWEPT_FACTORS
from bench.detectors_report.comparison import BASELINE
from bench.detectors_report.hits import DEFAULT, SPEED_BINS_M_S, at_any_speed, plain
from bench.detectors_report.numbers import Entry, Hits, detection_rate, shown
from bench.paper.figures import finish, new_figure

MARKS = "os^vDPX*"
# A detector without a false alarm is drawn at the left edge: a logarithm has no zero.
NEVER_PER_HOUR = 0.05


def roc_figure(hits: Hits, cases: Sequence[FlightCase], flights: Mapping[int, Entry]) -> Figure:
    """Detection rate over false alarms an hour, one line a detector, its main threshold from low to high."""
    figure, axes = new_figure(
        len(AIRFRAMES), len(SWEPT_RATES), "Detection rate against false alarms, threshold × 1/4 to × 4", 5.6, 3.8
    )
    per_hour = {name: _alarms_per_hour(cases, flights, name) for name in hits.detectors}
    for row, airframe in enumerate(AIRFRAMES):
        for column, rate in enumerate(SWEPT_RATES):
            axis = axes[row, column]
            for mark, name in zip(MARKS, hits.detectors, strict=False):
                found = _found_at_factors(hits, name, airframe, rate)
                if not len(found) or not len(per_hour[name]):
                    continue
                x = np.maximum(per_hour[name], NEVER_PER_HOUR)
                axis.plot(x, 100 * found, marker=mark, markersize=4, linewidth=1.0, label=name)
                middle = SWEPT_FACTORS.index(1.0)
                axis.plot(x[middle], 100 * found[middle], "o", markersize=11, markerfacecolor="none", color="black")
            axis.set_xscale("log")
            axis.set_ylim(-3, 103)
            finish(
                axis,
                f"{airframe}, {rate} Hz",
                "detected [%]",
                f"false alarms an hour ({SWEPT_RATE} Hz; at {NEVER_PER_HOUR}: none); circle: default",
            )
            axis.legend(fontsize=7, loc="lower right")
    return figure


def _alarms_per_hour(cases: Sequence[FlightCase], flights: Mapping[int, Entry], name: str) -> Any:
    swept = [
        (flight["seconds"], flight["rates"][str(SWEPT_RATE)][name]["swept"])
        for number, flight in flights.items()
        if cases[number].sweeps and name in flight["rates"][str(SWEPT_RATE)]
    ]
    hours = sum(seconds for seconds, _ in swept) / 3600.0
    return np.array([sum(counts[k] for _, counts in swept) / hours for k in range(len(SWEPT_FACTORS))] if hours else [])


def _found_at_factors(hits: Hits, name: str, airframe: str, rate: int) -> Any:
    swept = [
        hit["rates"][str(rate)]["swept"][name]
        for number, hit in hits.results.items()
        if plain(airframe)(hits.cases[number]) and name in hit["rates"][str(rate)]["swept"]
    ]
    return np.mean(np.array(swept, float), axis=0) if swept else np.array([])


def speed_figure(hits: Hits) -> Figure:
    """Detection rate by speed: every detector, each airframe and rate."""
    figure, axes = new_figure(len(AIRFRAMES), len(ASKED_HZ), "Detection rate by speed of the hit", 4.4, 3.4)
    edges = np.array(SPEED_BINS_M_S)
    for row, airframe in enumerate(AIRFRAMES):
        for column, rate in enumerate(ASKED_HZ):
            axis = axes[row, column]
            for mark, name in zip(MARKS, hits.detectors, strict=False):
                scored = hits.scored(name, rate, at_any_speed(airframe))
                rates = [
                    detection_rate([hit for hit in scored if low <= hit.case.speed_m_s < high])
                    for low, high in itertools.pairwise(edges)
                ]
                axis.plot((edges[:-1] + edges[1:]) / 2, 100 * np.array(rates), marker=mark, markersize=4, label=name)
            axis.set_ylim(-3, 103)
            finish(axis, f"{airframe}, {rate} Hz", "detected [%]", "speed [m/s]")
    axes[0, 0].legend(fontsize=7, loc="lower right")
    return figure


def latency_figure(hits: Hits) -> Figure:
    """How long after the first touch the report came: default and baseline."""
    figure, axes = new_figure(len(AIRFRAMES), len(ASKED_HZ), "From the first touch to the report", 4.4, 3.2)
    bins = np.linspace(0, 60, 61)
    for row, airframe in enumerate(AIRFRAMES):
        for column, rate in enumerate(ASKED_HZ):
            axis = axes[row, column]
            scored = hits.scored(DEFAULT, rate, plain(airframe))
            seen = [hit.entry["latency_ms"] for hit in shown(scored)]
            between = [hit.entry["latency_ms"] for hit in scored if hit.is_found and hit.fell_between]
            axis.hist(np.clip(seen, 0, 60), bins, label=f"{DEFAULT}, force in a sample", alpha=0.8)
            axis.hist(np.clip(between, 0, 60), bins, label=f"{DEFAULT}, between the samples", alpha=0.8)
            baseline = hits.scored(BASELINE, rate, plain(airframe)) if BASELINE in hits.detectors else []
            axis.hist(
                np.clip([hit.entry["latency_ms"] for hit in baseline if hit.is_found], 0, 60),
                bins,
                histtype="step",
                color="black",
                label=BASELINE,
            )
            finish(axis, f"{airframe}, {rate} Hz", "hits", "latency [ms], 60 and more in the last")
    axes[0, 0].legend(fontsize=7)
    return figure
