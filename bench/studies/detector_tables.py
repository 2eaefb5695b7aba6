"""Tables and pictures of the detectors. Frames are by campaign, a row for each case, rate and detector."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bench.cases.hits import SPEEDS_M_S
from bench.cases.vehicles import AIRFRAMES
from bench.fly.watching import ASKED_HZ, SWEPT_FACTORS
from bench.rows.heard import SWEPT_RATE, SWEPT_RATES
from bench.rows.tables import per_cent, percentile, rms, share, table, text_of
from bench.studies.detector_bars import DEFAULT, plain

SPEED_BINS_M_S = [0.3, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0]
# A detector without a false alarm is drawn at the left edge: a logarithm has no zero.
NEVER_PER_HOUR = 0.05
MARKS = "os^vDPX*"


def all_tables(frames: Mapping[str, pd.DataFrame]) -> dict[str, str]:
    """By their headings."""
    hits = frames["hits"].assign(band=pd.cut(frames["hits"]["speed_m_s"], SPEED_BINS_M_S, right=False))
    counted = hits[(hits["family"] == "plain") & (hits["speed_m_s"] >= SPEEDS_M_S[0])]
    ours, usual = hits[hits["detector"] == DEFAULT], ["airframe", "rate"]
    return {
        "Every detector on simulated hits": by(counted, "detector", *usual),
        "By obstacle": by(counted[counted["detector"] == DEFAULT], "approach", *usual),
        "By speed": by(ours[ours["family"] == "plain"], "band", *usual),
        "By vibration": by(ours[ours["family"] == "vibration"], "vibration_m_s2", *usual),
        "By the quality of the vehicle's velocity": by(
            ours[ours["family"] == "velocity"], "velocity_noise_m_s", *usual
        ),
        "Over a bad link, and struck in hover": by(
            hits[hits["family"].isin(["link", "struck"])], "family", "detector", *usual
        ),
        "In a person's hand": hands_table(frames["hands"]),
        "Healthy flights, simulated": alarms_table(frames["flights"], "detector", "rate"),
        "By kind of flight": alarms_table(
            frames["flights"][frames["flights"]["detector"] == DEFAULT], "family", "rate"
        ),
    }


def by(hits: pd.DataFrame, *keys: str) -> str:
    """What is found of each group, when, and how well it is known."""
    groups = hits.groupby(list(keys), observed=True, sort=keys[0] != "detector")
    return table([dict(zip(keys, key, strict=True)) | _figures(group) for key, group in groups])


def _figures(hits: pd.DataFrame) -> dict[str, object]:
    late, between = hits["latency_ms"], hits[hits["possible_ms"].isna()]
    seen = hits[late.notna() & hits["possible_ms"].notna()]
    return {
        "hits": len(hits),
        "found [%]": per_cent(share(late.notna()), 2),
        "between the samples": f"{between['latency_ms'].notna().sum()} / {len(between)}",
        "after the first possible sample [%]": per_cent(share(seen["samples_late"] > 0), 2),
        "latency, median / 99 % [ms]": f"{text_of(percentile(late, 50))} / {text_of(percentile(late, 99))}",
        "false before": int(hits["false"].sum()),
        "v_c error, RMS [m/s]": text_of(rms(hits["speed_error_m_s"].dropna()), 3),
        "normal error, median / 95 % [°]": f"{text_of(percentile(hits['normal_error_deg'], 50), 0)} / "
        f"{text_of(percentile(hits['normal_error_deg'], 95), 0)}",
    }


def hands_table(hands: pd.DataFrame) -> str:
    groups = hands.assign(wrong=hands["collisions"].map(bool)).groupby(["grip", "detector", "rate"])
    figures = groups.agg(
        hands=("wrong", "size"), taken_for_a_collision=("wrong", "sum"), told=("told_after_ms", "count")
    )
    return table(figures.assign(after_ms=groups["told_after_ms"].median().round(1)).reset_index())


def alarms_table(flights: pd.DataFrame, *keys: str) -> str:
    """False alarms of healthy flights, an hour."""
    groups = flights.assign(
        hours=flights["true_seconds"] / 3600.0,
        alarms=flights["alarms"].map(len),
        in_air=flights["alarms"].map(lambda told: sum(phase not in ("landing", "landed") for _, phase, _ in told)),
        phases=flights["alarms"].map(lambda told: ", ".join(sorted({phase for _, phase, _ in told}))),
    ).groupby(list(keys), sort=False)
    figures = groups[["hours", "alarms", "in_air", "touches"]].sum()
    per_hour = (figures[["alarms", "in_air"]].div(figures["hours"], axis=0)).round(2).add_suffix("_per_hour")
    phases = groups["phases"].agg(lambda found: ", ".join(sorted({phase for phase in found if phase})))
    return table(figures.round(2).join(per_hour).assign(phases=phases).reset_index())


def figures(frames: Mapping[str, pd.DataFrame]) -> dict[str, Figure]:
    return {"roc.png": roc_figure(frames["hits"], frames["flights"]), "speed.png": speed_figure(frames["hits"])}


def roc_figure(hits: pd.DataFrame, flights: pd.DataFrame) -> Figure:
    """Detection rate over false alarms an hour, one line a detector, its main threshold from low to high."""
    figure = Figure(figsize=(11.2, 8.0), layout="constrained")
    figure.suptitle("Detection rate against false alarms, threshold × 1/4 to × 4; ring: default")
    axes = figure.subplots(len(AIRFRAMES), len(SWEPT_RATES), squeeze=False)
    quiet = flights[flights["swept"].notna() & (flights["rate"] == SWEPT_RATE)]
    for (row, column), axis in np.ndenumerate(axes):
        airframe, rate = AIRFRAMES[row], SWEPT_RATES[column]
        some = plain(hits[hits["swept"].notna()], airframe, rate)
        for mark, name in zip(MARKS, hits["detector"].unique(), strict=False):
            found, alarms = (frame[frame["detector"] == name] for frame in (some, quiet))
            if len(found) and len(alarms):
                across = np.sum(alarms["swept"].tolist(), axis=0) / (alarms["true_seconds"].sum() / 3600.0)
                x, y = np.maximum(across, NEVER_PER_HOUR), 100 * np.mean(found["swept"].tolist(), axis=0)
                axis.plot(x, y, marker=mark, markersize=4, linewidth=1.0, label=name)
                middle = SWEPT_FACTORS.index(1.0)
                axis.plot(x[middle], y[middle], "o", markersize=11, markerfacecolor="none", color="black")
        axis.set(title=f"{airframe}, {rate} Hz", xscale="log", ylim=(-3, 103), ylabel="detected [%]")
        axis.set_xlabel(f"false alarms an hour ({SWEPT_RATE} Hz; at {NEVER_PER_HOUR}: none)")
        axis.legend(fontsize=7, loc="lower right")
    return figure


def speed_figure(hits: pd.DataFrame) -> Figure:
    """Detection rate by speed: every detector, each airframe and rate."""
    figure = Figure(figsize=(13.2, 6.8), layout="constrained")
    figure.suptitle("Detection rate by speed of the hit")
    axes, rates = figure.subplots(len(AIRFRAMES), len(ASKED_HZ), squeeze=False), list(ASKED_HZ)
    for (row, column), axis in np.ndenumerate(axes):
        some = plain(hits, AIRFRAMES[row], rates[column], 0.0)
        bands = pd.cut(some["speed_m_s"], SPEED_BINS_M_S, right=False)
        found = some["latency_ms"].notna().groupby([some["detector"], bands], observed=True).mean()
        for mark, name in zip(MARKS, some["detector"].unique(), strict=False):
            of_detector = found[name]
            middles = [band.mid for band in of_detector.index]
            axis.plot(middles, 100 * of_detector, marker=mark, markersize=4, label=name)
        axis.set(
            title=f"{AIRFRAMES[row]}, {rates[column]} Hz", ylim=(-3, 103), xlabel="speed [m/s]", ylabel="detected [%]"
        )
        axis.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=7, loc="lower right")
    return figure
