"""What the default detector must show, line by line, with the figures and a verdict. Frames are by campaign."""

from collections.abc import Iterator, Mapping

import pandas as pd

from bench.cases.hits import GRIPS, SPEEDS_M_S
from bench.fly.watching import ASKED_HZ, FLOWN_WITH, FOUND_WITHIN_US
from bench.rows.tables import Bar, per_cent, percentile, rms, share, text_of
from companion.reflex.detector import ImpactKind

(DEFAULT,), BASELINE = FLOWN_WITH, "threshold"
# By airframe and rate received.
FOUND_BARS = {
    **{("foldable", rate): 1.0 for rate in ASKED_HZ},
    ("rigid", 246): 1.0,
    ("rigid", 100): 0.995,
    ("rigid", 50): 0.97,
}
LATE_BAR = 0.01
# v_c is judged as a share of the speed from here on.
FAST_M_S, SPEED_ERROR_BAR_M_S, SPEED_ERROR_BAR = 2.0, 0.05, 0.03
HEAD_ON_DEG, HEAD_ON_BAR_DEG, ALL_BAR_DEG, NORMAL_FROM_M_S = 30.0, 10.0, 20.0, 1.0
HOURS_BAR = 10.0
EARLIER_BAR, FOUND_WITHIN_MS = 10.0, 1e-3 * FOUND_WITHIN_US
# The family of a hit, and of which of them the bar speaks.
BESIDE = {"link": "link with jitter, loss and reordering", "struck": "struck in hover at 0.5 to 3 m/s"}


def all_bars(frames: Mapping[str, pd.DataFrame]) -> list[Bar]:
    hits = frames["hits"]
    ours = hits[hits["detector"] == DEFAULT]
    groups = {key: plain(ours, *key) for key in FOUND_BARS}
    bars = [found_bar(airframe, rate, "0.5 to 5 m/s", some) for (airframe, rate), some in groups.items()]
    for judge in (_latency_bars, _speed_bars, _normal_bars, _contact_bars):
        bars += [bar for key, some in groups.items() for bar in judge(*key, some)]
    for family, what in BESIDE.items():
        least_m_s = SPEEDS_M_S[0] if family == "link" else 0.0
        some = ours[(ours["family"] == family) & (ours["speed_m_s"] >= least_m_s)]
        bars += [found_bar(airframe, rate, what, _of(some, airframe, rate)) for airframe, rate in FOUND_BARS]
    bars += hand_bars(frames["hands"]) + flight_bars(frames["flights"])
    return bars + list(_beside_baseline(hits, frames["flights"]))


def _of(hits: pd.DataFrame, airframe: str, rate: int) -> pd.DataFrame:
    return hits[(hits["airframe"] == airframe) & (hits["rate"] == rate)]


def plain(hits: pd.DataFrame, airframe: str, rate: int, least_m_s: float = SPEEDS_M_S[0]) -> pd.DataFrame:
    """By the airframe as it is, at the speeds that count."""
    return _of(hits[(hits["family"] == "plain") & (hits["speed_m_s"] >= least_m_s)], airframe, rate)


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
    yield Bar(
        f"{airframe}, {rate} Hz: at the first sample that shows it",
        "one sample later ≤ 1 %, none later",
        f"{per_cent(later, 2)} % one later, {per_cent(more, 2)} % more",
        later <= LATE_BAR and more == 0.0 if len(seen) else None,
        f"{len(seen)} hits",
    )
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
    """Judged for the foldable airframe, reported for the rigid one."""
    chosen, judged = hits[hits["latency_ms"].notna() & (hits["speed_m_s"] > NORMAL_FROM_M_S)], airframe == "foldable"
    if judged:
        chosen = chosen[~chosen["true_clipped"].astype(bool)]
    near = chosen[chosen["true_off_head_on_deg"] <= HEAD_ON_DEG]
    # A round's normal is another one a centimetre on, and both guards may meet it: what flat surfaces alone give.
    flat = {"": chosen["approach"] == chosen["approach"], ", without poles": chosen["approach"] != "pole"}
    for words, kept in flat.items():
        for what, limit, every in (("within 30° of head-on", HEAD_ON_BAR_DEG, near), ("all", ALL_BAR_DEG, chosen)):
            errors = every[kept.reindex(every.index)]["normal_error_deg"]
            inside, has_bar = share(errors <= limit), judged and not words
            yield Bar(
                f"{airframe}, {rate} Hz{', unclipped' if judged else ''}: normal, {what}{words}",
                f"{limit:g}° for 95 %" if has_bar else "no bar",
                f"{per_cent(inside)} % within {limit:g}°; 95 %: {text_of(percentile(errors, 95))}°",
                inside >= 0.95 if has_bar and len(errors) else None,
                f"{len(errors)} hits",
            )


def _contact_bars(airframe: str, rate: int, hits: pd.DataFrame) -> Iterator[Bar]:
    """When it was, and how honest the impulse is."""
    found = hits[hits["latency_ms"].notna()]
    clipped = found[found["true_clipped"].astype(bool)]
    if not len(clipped):
        return
    early, late = (text_of(percentile(found["time_error_ms"], part)) for part in (5, 95))
    bounds, impulse = share(clipped["bound"].astype(bool)), text_of(percentile(clipped["impulse"], 50), 2)
    where = f"{airframe}, {rate} Hz"
    yield Bar(
        f"{where}: time of contact", "no bar", f"{early} to {late} ms off (5 to 95 %)", None, f"{len(found)} hits"
    )
    measured = f"{per_cent(bounds)} %; impulse as told over the true change of velocity: {impulse} (median)"
    yield Bar(f"{where}, clipped: told as lower bounds", "no bar", measured, None, f"{len(clipped)} hits")


def hand_bars(hands: pd.DataFrame) -> list[Bar]:
    """A hand is never answered; whether it was felt at all depends on how firm it was."""
    bars = []
    for grip in GRIPS:
        for rate in ASKED_HZ:
            some = hands[(hands["detector"] == DEFAULT) & (hands["rate"] == rate) & (hands["grip"] == grip)]
            wrong, told = int(some["collisions"].map(bool).sum()), share(some["told_after_ms"].notna())
            bars.append(
                Bar(
                    f"{rate} Hz, hovering and {grip} by a hand: taken for a collision",
                    "none",
                    f"{wrong}; {per_cent(told)} % told as {ImpactKind.CONTACT.value}",
                    wrong == 0 if len(some) else None,
                    f"{len(some)} hands",
                )
            )
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


def _beside_baseline(hits: pd.DataFrame, flights: pd.DataFrame) -> Iterator[Bar]:
    some = hits[(hits["family"] == "plain") & (hits["speed_m_s"] >= SPEEDS_M_S[0])]
    sides = some.pivot_table("latency_ms", ["case", "rate"], "detector", dropna=False)[[BASELINE, DEFAULT]]
    both = sides.dropna()
    earlier, waited = percentile(both[BASELINE] / both[DEFAULT], 50), sides.fillna(FOUND_WITHIN_MS)
    theirs, ours = (int(missed) for missed in sides.isna().sum())
    alarms = flights["alarms"].map(len).groupby(flights["detector"]).sum()
    of, name = f"{len(both)} hits that both found, all rates", f"beside {BASELINE}"
    medians = f"{both[BASELINE].median():.1f} and {both[DEFAULT].median():.1f} ms"
    yield Bar(
        f"{name}: earlier",
        f"≥ {EARLIER_BAR:g} times",
        f"{earlier:.1f} times (median; {medians})",
        earlier >= EARLIER_BAR,
        of,
    )
    patient = percentile(waited[BASELINE] / waited[DEFAULT], 50)
    what = f"{name}: earlier, a miss counted as {FOUND_WITHIN_MS:g} ms"
    yield Bar(what, "no bar", f"{patient:.1f} times (median)", None, f"{len(waited)} hits")
    yield Bar(f"{name}: misses", "fewer", f"{ours} : {theirs}", ours < theirs, f"{len(sides)}")
    false = f"{alarms[DEFAULT]} : {alarms[BASELINE]}"
    yield Bar(f"{name}: false alarms", "fewer", false, bool(alarms[DEFAULT] < alarms[BASELINE]), "the same flights")
