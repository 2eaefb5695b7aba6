"""What the drone's own detector must show, and tables of all. A frame a campaign, a row a case, rate and detector."""

from collections.abc import Iterator, Mapping

import pandas as pd

from bench.cases.hits import GRIPS, SPEEDS_M_S
from bench.fly.watching import ASKED_HZ, FLOWN_WITH
from bench.rows.tables import Bar, per_cent, percentile, rms, share, table, text_of
from companion.reflex.detector import ImpactKind

(DEFAULT,), SLOWEST_M_S = FLOWN_WITH, SPEEDS_M_S[0]
# By airframe and rate received.
FOUND_BARS = {("foldable", rate): 1.0 for rate in ASKED_HZ}
FOUND_BARS |= {("rigid", 246): 1.0, ("rigid", 100): 0.995, ("rigid", 50): 0.97}
LATE_BAR, HOURS_BAR = 0.01, 10.0
# v_c is judged as a share of the speed from here on.
FAST_M_S, SPEED_ERROR_BAR_M_S, SPEED_ERROR_BAR = 2.0, 0.05, 0.03
HEAD_ON_DEG, HEAD_ON_BAR_DEG, ALL_BAR_DEG, NORMAL_FROM_M_S = 30.0, 10.0, 20.0, 1.0
# The family of a hit, in words, and from which speed on the bar speaks of it.
BESIDE = {
    "link": ("link with jitter, loss and reordering", SLOWEST_M_S),
    "struck": ("struck in hover at 0.5 to 3 m/s", 0.0),
}
SPEED_BINS_M_S = [0.3, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0]
USUAL = ("airframe", "rate")


def all_tables(frames: Mapping[str, pd.DataFrame]) -> dict[str, str]:
    """By their headings; of every detector, and more of the drone's own."""
    hits = frames["hits"].assign(band=pd.cut(frames["hits"]["speed_m_s"], SPEED_BINS_M_S, right=False))
    ours, flights = hits[hits["detector"] == DEFAULT], frames["flights"]
    return {
        "Every detector on simulated hits": by(usual(hits), "detector", *USUAL),
        "By obstacle": by(usual(ours), "approach", *USUAL),
        "By speed": by(ours[ours["family"] == "plain"], "band", *USUAL),
        "By vibration": by(ours[ours["family"] == "vibration"], "vibration_m_s2", *USUAL),
        "By the quality of the vehicle's velocity": by(
            ours[ours["family"] == "velocity"], "velocity_noise_m_s", *USUAL
        ),
        "Over a bad link, and struck in hover": by(hits[hits["family"].isin(["link", "struck"])], "family", *USUAL),
        "In a person's hand": hands_table(frames["hands"]),
        "Healthy flights, simulated": alarms_table(flights, "detector", "rate"),
        "By kind of flight": alarms_table(flights[flights["detector"] == DEFAULT], "family", "rate"),
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
        "found [%]": per_cent(share(late.notna()), 2),
        "between the samples": f"{between['latency_ms'].notna().sum()} / {len(between)}",
        "after the first possible sample [%]": per_cent(share(seen["samples_late"] > 0), 2),
        "latency, median / 99 % [ms]": f"{text_of(percentile(late, 50))} / {text_of(percentile(late, 99))}",
        "false before": int(hits["false"].sum()),
        "v_c error, RMS [m/s]": text_of(rms(hits["speed_error_m_s"].dropna()), 3),
        "normal error, median / 95 % [°]": " / ".join(text_of(percentile(normal, part), 0) for part in (50, 95)),
    }


def hands_table(hands: pd.DataFrame) -> str:
    groups = hands.assign(wrong=hands["collisions"].map(bool)).groupby(["grip", "detector", "rate"])
    figures = groups.agg(
        hands=("wrong", "size"), taken_for_a_collision=("wrong", "sum"), told=("told_after_ms", "count")
    )
    return table(figures.assign(after_ms=groups["told_after_ms"].median().round(1)).reset_index())


def alarms_table(flights: pd.DataFrame, *keys: str) -> str:
    """False alarms of healthy flights, in all, in the air, and an hour."""
    told = flights["alarms"]
    in_air = told.map(lambda found: sum(phase not in ("landing", "landed") for _, phase, _ in found))
    counted = flights.assign(hours=flights["true_seconds"] / 3600.0, alarms=told.map(len), in_air=in_air)
    figures = counted.groupby(list(keys), sort=False)[["hours", "alarms", "in_air", "touches"]].sum()
    per_hour = figures[["alarms", "in_air"]].div(figures["hours"], axis=0).round(2).add_suffix("_per_hour")
    return table(figures.round(2).join(per_hour).reset_index())


# --- what must be shown of the drone's own detector


def all_bars(frames: Mapping[str, pd.DataFrame]) -> list[Bar]:
    """Frames are by campaign."""
    ours = frames["hits"][frames["hits"]["detector"] == DEFAULT]
    groups = {key: _of(usual(ours), *key) for key in FOUND_BARS}
    bars = [found_bar(*key, "0.5 to 5 m/s", some) for key, some in groups.items()]
    for judge in (_latency_bars, _speed_bars, _normal_bars):
        bars += [bar for key, some in groups.items() for bar in judge(*key, some)]
    for family, (what, least_m_s) in BESIDE.items():
        some = ours[(ours["family"] == family) & (ours["speed_m_s"] >= least_m_s)]
        bars += [found_bar(*key, what, _of(some, *key)) for key in FOUND_BARS]
    return bars + hand_bars(frames["hands"]) + flight_bars(frames["flights"])


def usual(hits: pd.DataFrame) -> pd.DataFrame:
    """By the airframe as it is, at the speeds that count."""
    return hits[(hits["family"] == "plain") & (hits["speed_m_s"] >= SLOWEST_M_S)]


def _of(hits: pd.DataFrame, airframe: str, rate: int) -> pd.DataFrame:
    return hits[(hits["airframe"] == airframe) & (hits["rate"] == rate)]


def found_bar(airframe: str, rate: int, what: str, hits: pd.DataFrame) -> Bar:
    wanted, late = FOUND_BARS[airframe, rate], hits["latency_ms"]
    found = share(late.notna())
    median, latest = (text_of(percentile(late, part)) for part in (50, 99))
    return Bar(
        f"{airframe}, {rate} Hz, {what}: detected",
        f"{'' if wanted == 1.0 else '≥ '}{100 * wanted:g} %",
        f"{per_cent(found, 2)} %, after {median} ms (median), {latest} (99 %)",
        found >= wanted if len(hits) else None,
        f"{len(hits)} hits, {late.isna().sum()} missed, {(hits['touches'] > 0).sum()} told as a mere contact, too, "
        f"{hits['false'].sum()} false before",
    )


def _latency_bars(airframe: str, rate: int, hits: pd.DataFrame) -> Iterator[Bar]:
    """At the first sample whose window held the contact's force above the noise; a hit may fall between samples."""
    seen = hits[hits["latency_ms"].notna() & hits["possible_ms"].notna()]
    later, more = share(seen["samples_late"] == 1), share(seen["samples_late"] > 1)
    is_met = later <= LATE_BAR and more == 0.0 if len(seen) else None
    what, wanted = f"{airframe}, {rate} Hz: at the first sample that shows it", "one sample later ≤ 1 %, none later"
    measured = f"{per_cent(later, 2)} % one later, {per_cent(more, 2)} % more"
    yield Bar(what, wanted, measured, is_met, f"{len(seen)} hits")
    between = hits[hits["possible_ms"].isna()]
    if len(between):
        found = f"{per_cent(share(between['latency_ms'].notna()))} % found"
        yield Bar(f"{airframe}, {rate} Hz: hits between the samples", "apart", found, None, f"{len(between)} hits")


def _speed_bars(airframe: str, rate: int, hits: pd.DataFrame) -> Iterator[Bar]:
    found = hits[hits["latency_ms"].notna()]
    fast = found[found["true_speed_m_s"] >= FAST_M_S]
    error, vector = rms(found["speed_error_m_s"]), rms(found["velocity_error_m_s"])
    relative = rms(fast["speed_error_m_s"] / fast["true_speed_m_s"])
    is_met = error <= SPEED_ERROR_BAR_M_S if len(found) else None
    measured = f"{error:.3f} m/s (as a vector {vector:.3f})"
    yield Bar(f"{airframe}, {rate} Hz: v_c", "≤ 0.05 m/s RMS", measured, is_met, f"{len(found)} hits")
    is_met, what = relative <= SPEED_ERROR_BAR if len(fast) else None, f"{airframe}, {rate} Hz: v_c from 2 m/s on"
    yield Bar(what, "≤ 3 % RMS", f"{100 * relative:.1f} %", is_met, f"{len(fast)} hits")


def _normal_bars(airframe: str, rate: int, hits: pd.DataFrame) -> Iterator[Bar]:
    """Judged for the foldable airframe where nothing clipped, reported for the rigid one."""
    chosen, judged = hits[hits["latency_ms"].notna() & (hits["speed_m_s"] > NORMAL_FROM_M_S)], airframe == "foldable"
    if judged:
        chosen = chosen[~chosen["true_clipped"].astype(bool)]
    near = chosen[chosen["true_off_head_on_deg"] <= HEAD_ON_DEG]
    for what, limit, some in (("within 30° of head-on", HEAD_ON_BAR_DEG, near), ("all", ALL_BAR_DEG, chosen)):
        errors = some["normal_error_deg"]
        inside = share(errors <= limit)
        yield Bar(
            f"{airframe}, {rate} Hz{', unclipped' if judged else ''}: normal, {what}",
            f"{limit:g}° for 95 %" if judged else "no bar",
            f"{per_cent(inside)} % within {limit:g}°; 95 %: {text_of(percentile(errors, 95))}°",
            inside >= 0.95 if judged and len(errors) else None,
            f"{len(errors)} hits",
        )


def hand_bars(hands: pd.DataFrame) -> list[Bar]:
    """A hand is never answered; whether it was felt at all depends on how firm it was."""
    bars = []
    for grip in GRIPS:
        for rate in ASKED_HZ:
            some = hands[(hands["detector"] == DEFAULT) & (hands["rate"] == rate) & (hands["grip"] == grip)]
            wrong, told = int(some["collisions"].map(bool).sum()), share(some["told_after_ms"].notna())
            what = f"{rate} Hz, hovering and {grip} by a hand: taken for a collision"
            measured = f"{wrong}; {per_cent(told)} % told as {ImpactKind.CONTACT.value}"
            bars.append(Bar(what, "none", measured, wrong == 0 if len(some) else None, f"{len(some)} hands"))
    return bars


def flight_bars(flights: pd.DataFrame) -> list[Bar]:
    bars = []
    for rate in ASKED_HZ:
        some = flights[(flights["detector"] == DEFAULT) & (flights["rate"] == rate)]
        alarms, hours = int(some["alarms"].map(len).sum()), some["true_seconds"].sum() / 3600.0
        what, measured = "false alarms in simulated flights, landings included", f"{alarms} in {hours:.1f} h"
        # Fewer hours without an alarm prove nothing yet; an alarm does.
        is_met = False if alarms else True if hours >= HOURS_BAR else None
        bars.append(Bar(f"{rate} Hz: {what}", f"none in {HOURS_BAR:g} h", measured, is_met, f"{len(some)} flights"))
    return bars
