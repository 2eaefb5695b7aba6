"""What the drone's own detector must show, and tables of all. A frame a campaign, a row a case, rate and detector."""

from collections.abc import Iterator, Mapping

import pandas as pd

from bench.cases.hits import SPEEDS_M_S
from bench.fly.wire import ASKED_HZ, FLOWN_WITH
from bench.rows.tables import Bar, per_cent, rms, share_bar, table, text_of

DEFAULT, SLOWEST_M_S = FLOWN_WITH, SPEEDS_M_S[0]
# By airframe and rate received.
FOUND_BARS = {("foldable", rate): 1.0 for rate in ASKED_HZ}
FOUND_BARS |= {("rigid", 246): 1.0, ("rigid", 100): 0.995, ("rigid", 50): 0.97}
LATE_BAR, HOURS_BAR = 0.01, 10.0
# v_c is judged as a share of the speed from here on.
FAST_M_S, SPEED_ERROR_BAR_M_S, SPEED_ERROR_BAR = 2.0, 0.05, 0.03
HEAD_ON_DEG, HEAD_ON_BAR_DEG, ALL_BAR_DEG, NORMAL_FROM_M_S = 30.0, 10.0, 20.0, 1.0
NORMAL_BAR = 0.95
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
    ours, hands, flights = (
        frame[frame["detector"] == DEFAULT] for frame in (frames[name] for name in ("hits", "hands", "flights"))
    )
    bars: list[Bar] = []
    for (airframe, rate), hits in ours.groupby(list(USUAL)):
        where, least = f"{airframe}, {rate} Hz", FOUND_BARS[airframe, rate]
        bars += _hit_bars(where, least, usual(hits))
        if airframe == "foldable":
            bars += _normal_bars(where, usual(hits))
        for family, (what, from_m_s) in BESIDE.items():
            beside = hits[(hits["family"] == family) & (hits["speed_m_s"] >= from_m_s)]
            bars.append(share_bar(f"{where}, {what}: detected", beside["latency_ms"].notna(), least))
    for (rate, grip), held in hands.groupby(["rate", "grip"]):
        bars.append(
            share_bar(f"{rate} Hz, {grip} by a hand in hover: no collision", ~held["collisions"].map(bool), 1.0)
        )
    return bars + [_alarm_bar(rate, flown) for rate, flown in flights.groupby("rate")]


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


def _normal_bars(where: str, hits: pd.DataFrame) -> Iterator[Bar]:
    """Judged for the foldable airframe where nothing clipped."""
    whole = hits[hits["latency_ms"].notna() & ~hits["true_clipped"].astype(bool)]
    chosen = whole[whole["speed_m_s"] > NORMAL_FROM_M_S]
    near = chosen[chosen["true_off_head_on_deg"] <= HEAD_ON_DEG]
    for what, most_deg, some in (("within 30° of head-on", HEAD_ON_BAR_DEG, near), ("all", ALL_BAR_DEG, chosen)):
        is_near = some["normal_error_deg"] <= most_deg
        yield share_bar(f"{where}, unclipped: normal within {most_deg:g}°, {what}", is_near, NORMAL_BAR)


def _alarm_bar(rate: int, flights: pd.DataFrame) -> Bar:
    alarms, hours = int(flights["alarms"].map(len).sum()), flights["true_seconds"].sum() / 3600.0
    what = f"{rate} Hz: false alarms in simulated flights, landings included"
    # Fewer hours without an alarm prove nothing yet; an alarm does.
    is_met = False if alarms else True if hours >= HOURS_BAR else None
    return Bar(what, f"none in {HOURS_BAR:g} h", f"{alarms} in {hours:.1f} h", is_met, f"{len(flights)} flights")
