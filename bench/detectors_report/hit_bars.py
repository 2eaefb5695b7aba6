"""What the default detector must show on the simulated hits."""

from collections.abc import Sequence

from bench.detectors.vehicles import AIRFRAMES
from bench.detectors.watching import ASKED_HZ
from bench.detectors_report.bars import Bar
from bench.detectors_report.hits import DEFAULT, FAST_M_S, plain
from bench.detectors_report.numbers import (
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

# What the default must show, by airframe and rate received.
FOUND_BARS = {
    **{("foldable", rate): 1.0 for rate in ASKED_HZ},
    ("rigid", 246): 1.0,
    ("rigid", 100): 0.995,
    ("rigid", 50): 0.97,
}
LATE_BAR = 0.01
SPEED_ERROR_BAR_M_S, SPEED_ERROR_BAR = 0.05, 0.03
HEAD_ON_DEG, HEAD_ON_BAR_DEG, ALL_BAR_DEG, NORMAL_FROM_M_S = 30.0, 10.0, 20.0, 1.0


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
    fast = [hit for hit in found if hit.hit["speed_m_s"] >= FAST_M_S]
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
    near = [hit for hit in chosen if hit.hit["off_head_on_deg"] <= HEAD_ON_DEG]
    bars = []
    for what, limit, part, has_bar in (
        ("within 30° of head-on", HEAD_ON_BAR_DEG, near, judged),
        ("all", ALL_BAR_DEG, chosen, judged),
        # A round's normal is another one a centimetre on, and both guards may meet it: what flat surfaces alone give.
        ("within 30° of head-on, without poles", HEAD_ON_BAR_DEG, _without_poles(near), False),
        ("all without poles", ALL_BAR_DEG, _without_poles(chosen), False),
    ):
        errors = [hit.entry["normal_error_deg"] for hit in part]
        inside = share(error <= limit for error in errors)
        bars.append(
            Bar(
                f"{airframe}, {rate} Hz{', unclipped' if judged else ''}: normal, {what}",
                f"{limit:g}° for 95 %" if has_bar else "no bar",
                f"{per_cent(inside)} % within {limit:g}°; 95 %: {text_of(percentile(errors, 95))}°",
                inside >= 0.95 if has_bar and errors else None,
                f"{len(errors)} hits",
            )
        )
    return bars


def _without_poles(hits: Sequence[Scored]) -> list[Scored]:
    return [hit for hit in hits if hit.case.approach != "pole"]


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
