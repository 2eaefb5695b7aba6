"""`bench detectors`: every collision detector on simulated hits, and in a hand."""

from argparse import Namespace
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from typing import Any

import pandas as pd

from bench.cases.hits import SPEEDS_M_S, HandCase, HitCase, draw_case, draw_hand
from bench.detectors.config import BaselineConfig
from bench.fly.campaign import Results
from bench.fly.wire import ASKED_HZ, FLOWN_WITH
from bench.rows.heard import OF_FOUND, work_out_heard
from bench.rows.tables import Bar, bars_text, per_cent, rms, share_bar, summary_text, table, text_of
from bench.studies.study import Shown, run_study

# Tried on everything. The others are compared on at least so many hits, and on one in eight at most sizes:
# all seven take three times as long as these two.
THOROUGH = ("fused", "threshold")
COMPARED_HITS, COMPARED_EVERY_AT_MOST = 400, 8
# Beside the hits of the airframes as they are, one in so many again with more vibration.
VARIED_SHARE = 16
# An IMU sample's spread on each axis; four public PX4 logs of healthy flights lie between 1.2 and 4 m/s^2.
VIBRATIONS_M_S2 = (0.05, 1.0, 2.0, 4.0)
# Of a hovering vehicle, by hand: one in so many each, by the default detector and the baseline alone.
# No more than these, which take two minutes of one core together; a missed one in a hundred shows.
SIDE_SHARE, SIDE_HITS_AT_MOST, HANDS_AT_MOST = 16, 240, 160
# What the drone's own detector must show, by airframe and rate received.
DEFAULT, SLOWEST_M_S = FLOWN_WITH, SPEEDS_M_S[0]
FOUND_BARS = {("foldable", rate): 1.0 for rate in ASKED_HZ}
FOUND_BARS |= {("rigid", 246): 1.0, ("rigid", 100): 0.995, ("rigid", 50): 0.97}
LATE_BAR = 0.01
# v_c is judged as a share of the speed from here on.
FAST_M_S, SPEED_ERROR_BAR_M_S, SPEED_ERROR_BAR = 2.0, 0.05, 0.03
SPEED_BINS_M_S = [0.3, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0]
USUAL = ("airframe", "rate")
Frames = Mapping[type[object], pd.DataFrame]


def run_detectors(options: Namespace) -> int:
    """0 when everything is written, whatever it says; 1 when a case failed."""
    hits, first = options.hits, options.first_seed
    cases: list[Any] = [*hit_cases(hits, first), *hand_cases(hits, first)]
    cases = [replace(case, is_drawn=options.vehicles == "drawn") for case in cases]
    return run_study(options, "detectors", "Detection", cases, work_out_heard, shown)


def shown(results: Results) -> Shown:
    frames: Frames = {kind: rows(results, kind) for kind in (HitCase, HandCase)}
    bars = all_bars(frames)
    parts = {"What must be shown": bars_text(bars), **all_tables(frames)}
    return Shown(parts, summary_text(bars), frames[HitCase])


def rows(results: Results, kind: type) -> pd.DataFrame:
    """One for each case of a kind, rate and detector: the case's own numbers, the truth's, and what was reported."""
    found = [
        {"case": at, **asdict(case), **row}
        for at, (case, heard) in enumerate(each for each in results.found if isinstance(each[0], kind))
        for row in heard["rows"]
    ]
    frame = pd.DataFrame(found).drop(columns="detectors")
    return frame.astype(dict.fromkeys(OF_FOUND, float)) if kind is HitCase else frame


def hit_cases(hits: int, first: int) -> list[HitCase]:
    """So many hits as the vehicles are, a sixteenth more that vibrate, and some in hover."""
    every = _every(hits, COMPARED_HITS)
    cases = [draw_case("plain", seed, _compared(seed, every)) for seed in range(first, first + hits)]
    first += hits
    for seed in range(first, first + hits // VARIED_SHARE):
        vibration = VIBRATIONS_M_S2[seed // 2 % len(VIBRATIONS_M_S2)]
        cases.append(draw_case("vibration", seed, _compared(seed, every), vibration_m_s2=vibration))
    # Where these seeds have always been.
    first += 3 * hits
    side = range(first, first + _side(hits, SIDE_HITS_AT_MOST))
    return cases + [draw_case("struck", seed, THOROUGH, is_struck=True) for seed in side]


def hand_cases(hits: int, first: int) -> list[HandCase]:
    """A hand's grips on a hovering vehicle, as many as belong to so many hits."""
    return [draw_hand(seed, THOROUGH) for seed in range(first, first + 2 * _side(hits, HANDS_AT_MOST // 2))]


def _side(hits: int, at_most: int) -> int:
    """In pairs, one for each airframe, and never none."""
    return 2 * max(1, min(at_most, hits // SIDE_SHARE) // 2)


def _every(cases: int, compared: int) -> int:
    """One in how many cases is for all detectors."""
    return max(1, min(COMPARED_EVERY_AT_MOST, cases // compared))


def _compared(seed: int, every: int) -> tuple[str, ...]:
    """In pairs, so that both airframes have their turns."""
    return tuple(BaselineConfig.detectors) if seed // 2 % every == 0 else THOROUGH


# --- tables: a frame a kind of case, a row a case, rate and detector


def all_tables(frames: Frames) -> dict[str, str]:
    """By their headings; of every detector, and more of the drone's own."""
    hits = frames[HitCase].assign(band=pd.cut(frames[HitCase]["speed_m_s"], SPEED_BINS_M_S, right=False))
    ours = hits[hits["detector"] == DEFAULT]
    return {
        "Every detector on simulated hits": by(usual(hits), "detector", *USUAL),
        "By obstacle": by(usual(ours), "approach", *USUAL),
        "By speed": by(ours[ours["family"] == "plain"], "band", *USUAL),
        "By vibration": by(ours[ours["family"] == "vibration"], "vibration_m_s2", *USUAL),
        "Struck in hover": by(hits[hits["family"] == "struck"], "detector", *USUAL),
        "In a person's hand": hands_table(frames[HandCase]),
    }


def by(hits: pd.DataFrame, *keys: str) -> str:
    """What is found of each group, when, and how well it is known."""
    groups = hits.groupby(list(keys), observed=True, sort=keys[0] != "detector")
    return table([dict(zip(keys, key, strict=True)) | _figures(group) for key, group in groups])


def _figures(hits: pd.DataFrame) -> dict[str, object]:
    late, between = hits["latency_ms"], hits[hits["possible_ms"].isna()]
    seen, normal = hits[late.notna() & hits["possible_ms"].notna()], hits["normal_error_deg"]
    return {
        "hits": len(hits),
        "found [%]": per_cent(late.notna().mean(), 2),
        "between the samples": f"{between['latency_ms'].notna().sum()} / {len(between)}",
        "after the first possible sample [%]": per_cent((seen["samples_late"] > 0).mean(), 2),
        "latency, median / 99 % [ms]": f"{text_of(late.quantile(0.5))} / {text_of(late.quantile(0.99))}",
        "false before": int(hits["false"].sum()),
        "v_c error, RMS [m/s]": text_of(rms(hits["speed_error_m_s"].dropna()), 3),
        "normal error, median / 95 % [°]": " / ".join(text_of(normal.quantile(part), 0) for part in (0.5, 0.95)),
    }


def hands_table(hands: pd.DataFrame) -> str:
    groups = hands.assign(wrong=hands["collisions"].map(bool)).groupby(["grip", "detector", "rate"])
    counted = {
        "hands": ("wrong", "size"),
        "taken_for_a_collision": ("wrong", "sum"),
        "told": ("told_after_ms", "count"),
    }
    figures = groups.agg(**counted)
    return table(figures.assign(after_ms=groups["told_after_ms"].median().round(1)).reset_index())


# --- what must be shown of the drone's own detector


def all_bars(frames: Frames) -> list[Bar]:
    ours, hands = (frames[kind].query("detector == @DEFAULT") for kind in (HitCase, HandCase))
    bars: list[Bar] = []
    for (airframe, rate), hits in ours.groupby(list(USUAL)):
        where, least = f"{airframe}, {rate} Hz", FOUND_BARS[airframe, rate]
        bars += _hit_bars(where, least, usual(hits))
        struck = hits[hits["family"] == "struck"]["latency_ms"].notna()
        bars.append(share_bar(f"{where}, struck in hover at 0.5 to 3 m/s: detected", struck, least))
    for (rate, grip), held in hands.groupby(["rate", "grip"]):
        what = f"{rate} Hz, {grip} by a hand in hover: no collision"
        bars.append(share_bar(what, ~held["collisions"].map(bool), 1.0))
    return bars


def usual(hits: pd.DataFrame) -> pd.DataFrame:
    """By the airframe as it is, at the speeds that count."""
    return hits[(hits["family"] == "plain") & (hits["speed_m_s"] >= SLOWEST_M_S)]


def _hit_bars(where: str, least: float, hits: pd.DataFrame) -> Iterator[Bar]:
    found = hits[hits["latency_ms"].notna()]
    fast = found[found["true_speed_m_s"] >= FAST_M_S]
    # A hit may fall between the samples; of one that does not the first is that whose window held its force.
    late = found[found["possible_ms"].notna()]["samples_late"]
    yield share_bar(f"{where}, 0.5 to 5 m/s: detected", hits["latency_ms"].notna(), least)
    yield share_bar(f"{where}: at the first sample that shows it", late == 0, 1.0 - LATE_BAR)
    yield share_bar(f"{where}: at the first sample that shows it, or the next", late <= 1, 1.0)
    yield _rms_bar(f"{where}: v_c [m/s]", found["speed_error_m_s"], SPEED_ERROR_BAR_M_S)
    relative = fast["speed_error_m_s"] / fast["true_speed_m_s"]
    yield _rms_bar(f"{where}: v_c from 2 m/s on, as a share", relative, SPEED_ERROR_BAR)


def _rms_bar(what: str, errors: "pd.Series[float]", most: float) -> Bar:
    error = rms(errors)
    is_met = error <= most if len(errors) else None
    return Bar(what, f"≤ {most:g} RMS", text_of(error, 3), is_met, f"{len(errors)} hits")
