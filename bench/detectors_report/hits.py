"""Tables of the simulated hits."""

import itertools
from collections.abc import Callable, Sequence

from bench.detectors.campaigns import VELOCITY_NOISES_M_S, VIBRATIONS_M_S2
from bench.detectors.hits import APPROACHES, SPEEDS_M_S, HitCase
from bench.detectors.vehicles import AIRFRAMES
from bench.detectors.watching import ASKED_HZ
from bench.detectors_report.numbers import (
    Hits,
    Scored,
    detection_rate,
    late_share,
    latencies_ms,
    per_cent,
    percentile,
    rms,
    shown,
    text_of,
)
from bench.paper.table import markdown
from sim_vehicle.airframe import load_built_in

DEFAULT = "fused"
# v_c is judged as a share of the speed from here on.
FAST_M_S = 2.0

SPEED_BINS_M_S = (0.3, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0)


def plain(airframe: str) -> Callable[[HitCase], bool]:
    """The airframe as it is, at the speeds that count."""
    return lambda case: case.family == "plain" and case.airframe == airframe and case.speed_m_s >= SPEEDS_M_S[0]


def at_any_speed(airframe: str) -> Callable[[HitCase], bool]:
    """The same with the slow hits below what is asked for."""
    return lambda case: case.family == "plain" and case.airframe == airframe


COMPARISON = (
    "detector",
    "airframe",
    "Hz",
    "hits",
    "found [%]",
    "between the samples, found / all",
    "after the first possible sample [%]",
    "latency, median / 99 % [ms]",
    "false before the hit",
    "v_c error, RMS [m/s]",
    "normal error, median / 95 % [°]",
)


def comparison_text(hits: Hits) -> str:
    """Every detector on the plain hits."""
    rows = [
        _row(detector, airframe, rate, scored)
        for detector in hits.detectors
        for airframe in AIRFRAMES
        for rate in ASKED_HZ
        if (scored := hits.scored(detector, rate, plain(airframe)))
    ]
    return markdown(COMPARISON, rows, left=2)


def _row(detector: str, airframe: str, rate: int, hits: Sequence[Scored]) -> list[str]:
    found = [hit for hit in hits if hit.is_found]
    between = [hit for hit in hits if hit.fell_between]
    late = latencies_ms(shown(hits))
    normals = [hit.entry["normal_error_deg"] for hit in found]
    return [
        detector,
        airframe,
        f"{rate}",
        f"{len(hits)}",
        per_cent(detection_rate(hits), 2),
        f"{sum(hit.is_found for hit in between)} / {len(between)}",
        per_cent(late_share(hits, 0), 2),
        f"{text_of(percentile(late, 50))} / {text_of(percentile(late, 99))}",
        f"{sum(hit.entry['false'] for hit in hits)}",
        text_of(rms(hit.entry["speed_error_m_s"] for hit in found), 3),
        f"{text_of(percentile(normals, 50), 0)} / {text_of(percentile(normals, 95), 0)}",
    ]


def approaches_text(hits: Hits) -> str:
    """The default detector by what was hit."""
    groups = [
        (f"{airframe}, {approach}", lambda case, a=airframe, b=approach: plain(a)(case) and case.approach == b)
        for airframe in AIRFRAMES
        for approach in APPROACHES
    ]
    return _by(hits, "airframe, obstacle", groups)


def speeds_text(hits: Hits) -> str:
    """The default detector by speed, the slow hits below what is asked for included."""
    groups = [
        (
            f"{airframe}, {low:g} to {high:g} m/s",
            lambda case, a=airframe, low=low, high=high: at_any_speed(a)(case) and low <= case.speed_m_s < high,
        )
        for airframe in AIRFRAMES
        for low, high in itertools.pairwise(SPEED_BINS_M_S)
    ]
    return _by(hits, "airframe, speed", groups)


def vibrations_text(hits: Hits) -> str:
    """The default detector on vehicles that shake."""
    groups = [
        (
            f"{airframe}, {level:g} m/s²",
            lambda case, a=airframe, level=level: (
                case.family == "vibration" and case.airframe == a and case.vibration_m_s2 == level
            ),
        )
        for airframe in AIRFRAMES
        for level in VIBRATIONS_M_S2
    ]
    return _by(hits, "airframe, spread of a sample on each axis", groups)


def _by(hits: Hits, head: str, groups: Sequence[tuple[str, Callable[[HitCase], bool]]]) -> str:
    columns = [head, "hits"]
    for rate in ASKED_HZ:
        columns += [f"{rate} Hz: found [%]", "latency, median / 99 % [ms]", "v_c [m/s]", "normal, 95 % [°]"]
    columns.append("false before")
    rows = []
    for name, which in groups:
        by_rate = [hits.scored(DEFAULT, rate, which) for rate in ASKED_HZ]
        if not by_rate[0]:
            continue
        row = [name, f"{len(by_rate[0])}"]
        for scored in by_rate:
            found = [hit for hit in scored if hit.is_found]
            late = latencies_ms(scored)
            row += [
                per_cent(detection_rate(scored), 2),
                f"{text_of(percentile(late, 50))} / {text_of(percentile(late, 99))}",
                text_of(rms(hit.entry["speed_error_m_s"] for hit in found), 3),
                text_of(percentile([hit.entry["normal_error_deg"] for hit in found], 95), 0),
            ]
        row.append(f"{sum(hit.entry['false'] for scored in by_rate for hit in scored)}")
        rows.append(row)
    return markdown(columns, rows)


def velocity_text(hits: Hits) -> str:
    """How v_c and the normal go with the quality of the vehicle's own velocity estimate."""
    rows = []
    for airframe in AIRFRAMES:
        own = load_built_in(airframe).estimate.velocity_noise_m_s
        groups = {own: plain(airframe), **{noise: _with_noise(airframe, noise) for noise in VELOCITY_NOISES_M_S}}
        for noise in sorted(groups):
            scored = hits.scored(DEFAULT, 246, groups[noise])
            found = [hit for hit in scored if hit.is_found]
            fast = [hit for hit in found if hit.hit["speed_m_s"] >= FAST_M_S]
            if not found:
                continue
            rows.append(
                [
                    airframe,
                    f"{noise:g}",
                    f"{len(scored)}",
                    per_cent(detection_rate(scored), 2),
                    f"{rms(hit.entry['speed_error_m_s'] for hit in found):.3f}",
                    f"{rms(hit.entry['velocity_error_m_s'] for hit in found):.3f}",
                    text_of(100 * rms(hit.entry["speed_error_m_s"] / hit.hit["speed_m_s"] for hit in fast)),
                    text_of(percentile([hit.entry["normal_error_deg"] for hit in found], 95), 0),
                ]
            )
    columns = (
        "airframe",
        "velocity noise, RMS on each axis [m/s]",
        "hits",
        "found [%]",
        "v_c error, RMS [m/s]",
        "as a vector [m/s]",
        "from 2 m/s on [%]",
        "normal, 95 % [°]",
    )
    return markdown(columns, rows)


def _with_noise(airframe: str, noise_m_s: float) -> Callable[[HitCase], bool]:
    return lambda case: case.family == "velocity" and case.airframe == airframe and case.velocity_noise_m_s == noise_m_s
