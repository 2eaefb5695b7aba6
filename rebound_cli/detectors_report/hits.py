"""Tables of the simulated hits."""

import itertools
from collections.abc import Callable, Sequence

from rebound_cli.detectors.campaigns import VELOCITY_NOISES_M_S, VIBRATIONS_M_S2
from rebound_cli.detectors.hits import AIRFRAMES, APPROACHES, SPEEDS_M_S, HitCase
from rebound_cli.detectors.watching import ASKED_HZ
from rebound_cli.detectors_report.bars import Bar
from rebound_cli.detectors_report.numbers import (
    Hits,
    Scored,
    detection_rate,
    late_share,
    latencies_ms,
    per_cent,
    percentile,
    rms,
    share,
    shown,
    text_of,
)
from rebound_cli.paper.table import markdown
from sim_vehicle.airframe import load_built_in

DEFAULT = "fused"
# Of the issue: what the default must show, by airframe and rate received.
FOUND_BARS = {
    **{("foldable", rate): 1.0 for rate in ASKED_HZ},
    ("rigid", 246): 1.0,
    ("rigid", 100): 0.995,
    ("rigid", 50): 0.97,
}
LATE_BAR = 0.01
SPEED_ERROR_BAR_M_S, SPEED_ERROR_BAR, SPEED_ERROR_FROM_M_S = 0.05, 0.03, 2.0
HEAD_ON_DEG, HEAD_ON_BAR_DEG, ALL_BAR_DEG, NORMAL_FROM_M_S = 30.0, 10.0, 20.0, 1.0

SPEED_BINS_M_S = (0.3, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0)


def plain(airframe: str) -> Callable[[HitCase], bool]:
    """The airframe as it is, at the speeds that count."""
    return lambda case: case.family == "plain" and case.airframe == airframe and case.speed_m_s >= SPEEDS_M_S[0]


def at_any_speed(airframe: str) -> Callable[[HitCase], bool]:
    """The same with the slow hits below what is asked for."""
    return lambda case: case.family == "plain" and case.airframe == airframe


# --- bars ------------------------------------------------------------------------------------------------------------


def hit_bars(hits: Hits) -> list[Bar]:
    bars: list[Bar] = []
    groups = {
        (airframe, rate): hits.scored(DEFAULT, rate, plain(airframe)) for airframe in AIRFRAMES for rate in ASKED_HZ
    }
    for (airframe, rate), scored in groups.items():
        bars.append(_found_bar(airframe, rate, scored))
    for (airframe, rate), scored in groups.items():
        bars += _latency_bars(airframe, rate, scored)
    for (airframe, rate), scored in groups.items():
        bars += _speed_bars(airframe, rate, scored)
    for (airframe, rate), scored in groups.items():
        bars += _normal_bars(airframe, rate, scored)
    for (airframe, rate), scored in groups.items():
        bars += _contact_bars(airframe, rate, scored)
    return bars


def _found_bar(airframe: str, rate: int, hits: Sequence[Scored]) -> Bar:
    wanted, found = FOUND_BARS[airframe, rate], detection_rate(hits)
    return Bar(
        f"{airframe}, {rate} Hz, 0.5 to 5 m/s: detected",
        f"{'' if wanted == 1.0 else '≥ '}{100 * wanted:g} %",
        f"{per_cent(found, 2)} %",
        found >= wanted if hits else None,
        f"{len(hits)} hits, {sum(not hit.is_found for hit in hits)} missed",
    )


def _latency_bars(airframe: str, rate: int, hits: Sequence[Scored]) -> list[Bar]:
    seen, between = shown(hits), [hit for hit in hits if hit.fell_between]
    later, much_later = late_share(hits, 0), late_share(hits, 1)
    where = f"{airframe}, {rate} Hz"
    bars = [
        Bar(
            f"{where}: at the first sample that shows it",
            "one sample later ≤ 1 %, none later",
            f"{per_cent(later - much_later, 2)} % one later, {per_cent(much_later, 2)} % more",
            later - much_later <= LATE_BAR and much_later == 0.0 if seen else None,
            f"{len(seen)} hits",
        )
    ]
    if between:
        late = latencies_ms(between)
        bars.append(
            Bar(
                f"{where}: hits between the samples",
                "apart",
                f"{per_cent(detection_rate(between))} % found, after {text_of(percentile(late, 50))} ms (median), "
                f"{text_of(percentile(late, 99))} ms (99 %)",
                None,
                f"{len(between)} hits",
            )
        )
    return bars


def _speed_bars(airframe: str, rate: int, hits: Sequence[Scored]) -> list[Bar]:
    found = [hit for hit in hits if hit.is_found]
    error = rms(hit.entry["speed_error_m_s"] for hit in found)
    vector = rms(hit.entry["velocity_error_m_s"] for hit in found)
    fast = [hit for hit in found if hit.hit["speed_m_s"] >= SPEED_ERROR_FROM_M_S]
    relative = rms(hit.entry["speed_error_m_s"] / hit.hit["speed_m_s"] for hit in fast)
    return [
        Bar(
            f"{airframe}, {rate} Hz: v_c",
            "≤ 0.05 m/s RMS",
            f"{error:.3f} m/s (as a vector {vector:.3f})",
            error <= SPEED_ERROR_BAR_M_S if found else None,
            f"{len(found)} hits",
        ),
        Bar(
            f"{airframe}, {rate} Hz: v_c from 2 m/s on",
            "≤ 3 % RMS",
            f"{100 * relative:.1f} %",
            relative <= SPEED_ERROR_BAR if fast else None,
            f"{len(fast)} hits",
        ),
    ]


def _normal_bars(airframe: str, rate: int, hits: Sequence[Scored]) -> list[Bar]:
    """Judged for the foldable airframe, reported for the rigid one."""
    chosen = [hit for hit in hits if hit.is_found and hit.case.speed_m_s > NORMAL_FROM_M_S]
    judged = airframe == "foldable"
    if judged:
        chosen = [hit for hit in chosen if not hit.hit["clipped"]]
    bars = []
    for what, limit, part in (
        ("within 30° of head-on", HEAD_ON_BAR_DEG, [h for h in chosen if h.hit["off_head_on_deg"] <= HEAD_ON_DEG]),
        ("all", ALL_BAR_DEG, chosen),
    ):
        errors = [hit.entry["normal_error_deg"] for hit in part]
        inside = share(error <= limit for error in errors)
        bars.append(
            Bar(
                f"{airframe}, {rate} Hz{', unclipped' if judged else ''}: normal, {what}",
                f"{limit:g}° for 95 %" if judged else "no bar",
                f"{per_cent(inside)} % within {limit:g}°; 95 %: {text_of(percentile(errors, 95))}°",
                inside >= 0.95 if judged and errors else None,
                f"{len(errors)} hits",
            )
        )
    return bars


def _contact_bars(airframe: str, rate: int, hits: Sequence[Scored]) -> list[Bar]:
    """When it was, and how honest the impulse is."""
    found = [hit for hit in hits if hit.is_found]
    clipped = [hit for hit in found if hit.hit["clipped"]]
    if not clipped:
        return []
    late = [hit.entry["time_error_ms"] for hit in found]
    impulses = [hit.entry["impulse"] for hit in clipped]
    return [
        Bar(
            f"{airframe}, {rate} Hz: time of contact",
            "no bar",
            f"{text_of(percentile(late, 5))} to {text_of(percentile(late, 95))} ms off (5 to 95 %)",
            None,
            f"{len(found)} hits",
        ),
        Bar(
            f"{airframe}, {rate} Hz, clipped: peak and impulse told as lower bounds",
            "no bar",
            f"{per_cent(share(hit.entry['bound'] for hit in clipped))} %; impulse as told over the true change of "
            f"velocity: {text_of(percentile(impulses, 50), 2)} (median)",
            None,
            f"{len(clipped)} hits",
        ),
    ]


# --- tables -----------------------------------------------------------------------------------------------------------

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
            fast = [hit for hit in found if hit.hit["speed_m_s"] >= SPEED_ERROR_FROM_M_S]
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
