"""`bench hits`: hits alone, from just before each to rest, or only until the guard tells of them; which were missed."""

import math
from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import asdict

import pandas as pd

from bench.fly.campaign import Campaign, Json, Results, Workers, run_campaign
from bench.fly.guarded import (
    FREE_S,
    HITS_AN_APPROACH,
    MOST_RECOVERY_S,
    OVERTURNED_DEG,
    FlownHit,
    approach_of,
    draw_flown,
)
from bench.fly.lockstep import NOTICED_M_S
from bench.rows.hits import work_out_approach, work_out_flown
from bench.rows.tables import (
    CONFIDENCE,
    Page,
    at_most,
    at_most_an_hour,
    at_most_of_groups,
    per_cent,
    table,
    text_of,
)

# Into the surface.
BANDS_M_S = [0.0, NOTICED_M_S, 1.0, 2.0, 3.0, 5.0]
# Of hits missed, and of false alarms.
BOUND = 0.01
NAMED_SEEDS = 12
# An hour on two cores, in seconds.
TWO_CORES_S = 2 * 3600.0
OF_FOUND = ("latency_ms", "again", "rest_s")


def flown_campaign(hits: int, first_seed: int, is_drawn: bool) -> Campaign:
    cases = [draw_flown(seed, is_drawn) for seed in range(first_seed, first_seed + hits)]
    # Not how many: a longer campaign goes on where a shorter one ended.
    return Campaign("flown-hits", {"first_seed": first_seed, "is_drawn": is_drawn}, cases, work_out_flown)


def verdict_campaign(hits: int, first_seed: int, is_drawn: bool) -> Campaign:
    """As many approaches as it takes for so many hits, if each obstacle is met."""
    seeds = range(first_seed, first_seed + math.ceil(hits / HITS_AN_APPROACH))
    cases = [draw_flown(seed, is_drawn) for seed in seeds]
    return Campaign("verdicts", {"first_seed": first_seed, "is_drawn": is_drawn}, cases, work_out_approach)


def run_hits(options: Namespace) -> int:
    """0 when it is written, whatever it says; 1 when a hit failed to be flown, or has another verdict flown again."""
    page, is_drawn = Page(options.out, "hits"), options.vehicles == "drawn"
    make = verdict_campaign if options.verdicts else flown_campaign
    campaign = make(options.hits, options.first_seed, is_drawn)
    results = run_campaign(campaign, Workers(options.jobs, options.scheduler))
    failed = results.text(campaign)
    if options.verdicts:
        rows = verdict_rows(campaign, results)
        parts = verdict_parts(rows, list(results.results.values()))
    else:
        rows = flown_rows(campaign, results)
        parts = flown_parts(rows)
    page.write("Hits alone", options.typed, parts, rows=rows)
    print(failed)
    return 1 if failed or not all(one.get("agrees", True) for one in results.results.values()) else 0


def _facts(case: FlownHit) -> Json:
    return {**asdict(case.hit), "imu_hz": case.imu_hz}


def flown_rows(campaign: Campaign, results: Results) -> pd.DataFrame:
    """One a hit that touched something, with a column for its band of speed."""
    found = [{**_facts(campaign.cases[at]), **one} for at, one in results.results.items()]
    frame = pd.DataFrame(found)
    frame["processor_s"] = [one["cost"]["processor_s"] for one in found]
    columns = [*frame.columns, *(name for name in OF_FOUND if name not in frame.columns)]
    return _banded(frame[frame["touched"]].reindex(columns=columns))


def verdict_rows(campaign: Campaign, results: Results) -> pd.DataFrame:
    """The same, several by one vehicle."""
    found = []
    for at, one in results.results.items():
        facts = _facts(campaign.cases[at])
        for number, closing_m_s, latency_ms in one["hits"]:
            told = {
                "number": number,
                "closing_m_s": closing_m_s,
                "latency_ms": latency_ms,
                "found": latency_ms is not None,
            }
            found.append({**facts, "approach": approach_of(number), **told})
    return _banded(pd.DataFrame(found))


def _banded(hits: pd.DataFrame) -> pd.DataFrame:
    return hits.assign(band=pd.cut(hits["closing_m_s"], BANDS_M_S, right=False).astype(str))


def flown_parts(hits: pd.DataFrame) -> dict[str, str]:
    hits = hits.astype({"found": bool})
    missed, false = ~hits["found"], hits["false"] > 0
    lead = (
        f"{len(hits)} hits, {missed.sum()} missed, {hits['false'].sum()} false alarms. Each vehicle begins in flight "
        f"and is guarded over the wire until it rests, for {MOST_RECOVERY_S:g} s at most. The truth judges.\n"
        f"{TWO_CORES_S / hits['processor_s'].median():,.0f} an hour on two cores, by the median.\n"
    )
    named = {
        "missed at 0.5 m/s and more": missed & (hits["closing_m_s"] >= NOTICED_M_S),
        "over": hits["tilt_deg"] > OVERTURNED_DEG,
        "with a false alarm": false,
    }
    cells, open_cells = _cells(hits, flown_cell)
    seeds = [{"hits": what, "number": int(which.sum()), "seeds": _seeds(hits[which])} for what, which in named.items()]
    return {
        "": lead,
        "By airframe, rate and speed": f"{cells}\n{_open(open_cells)}",
        "By what was met": table([{"met": met} | flown_cell(some) for met, some in hits.groupby("approach")]),
        "To look at again": table(seeds),
    }


def verdict_parts(hits: pd.DataFrame, results: Sequence[Json]) -> dict[str, str]:
    again = [one for one in results if "agrees" in one]
    false, hours = sum(one["false"] for one in results), sum(one["watched_s"] for one in results) / 3600.0
    spent_s = sum(one["cost"]["processor_s"] for one in results)
    lead = (
        f"{len(results):,} approaches with {len(hits):,} hits, {(~hits['found']).sum():,} missed. {len(again):,} were "
        f"flown again from the beginning, {sum(one['agrees'] for one in again):,} have the same verdict to the last "
        f"digit; the guard later took back {sum(not one['kept'] for one in again)} of them.\n"
        f"False alarms: {false}, in {hours:.2f} h of free flight from {FREE_S} s on; "
        f"at most {at_most_an_hour(false, hours):.2f} an hour.\n"
        f"{TWO_CORES_S * len(hits) / spent_s:,.0f} an hour on two cores.\n"
    )
    noticed = hits[hits["closing_m_s"] >= NOTICED_M_S]
    cells, open_cells = _cells(hits, verdict_cell)
    return {
        "": lead,
        "By airframe, rate and speed": f"{cells}\n{_open(open_cells)}",
        "By what was met, from 0.5 m/s on": table(
            [{"met": a} | verdict_cell(s) for a, s in noticed.groupby("approach")]
        ),
        "Missed at 0.5 m/s and more": _seeds(noticed[~noticed["found"]], "number") + "\n",
    }


def _cells(hits: pd.DataFrame, cell: Callable[[pd.DataFrame], dict[str, object]]) -> tuple[str, list[str]]:
    """The table, and the cells that are not shown to be below the bound."""
    rows, open_cells = [], []
    for (airframe, imu_hz, band), some in hits.groupby(["airframe", "imu_hz", "band"]):
        found = cell(some)
        rows.append({"airframe, IMU": f"{airframe}, {imu_hz} Hz", "speed [m/s]": band, **found})
        # Nothing of the kind was flown in the cell: nothing is shown of it.
        bounds = [str(text) for name, text in found.items() if name.startswith("at most")]
        largest = max(math.inf if text == "-" else float(text) for text in bounds)
        open_cells += [] if largest < 100 * BOUND else [f"{airframe}, {imu_hz} Hz, {band} m/s"]
    noticed = hits[hits["closing_m_s"] >= NOTICED_M_S]
    rows.append({"airframe, IMU": "all", "speed [m/s]": f"from {NOTICED_M_S:g} on", **cell(noticed)})
    return table(rows), open_cells


def _open(cells: Sequence[str]) -> str:
    return f"Not shown, at {100 * CONFIDENCE:g} %, to be below {100 * BOUND:g} %: {'; '.join(cells) or 'none'}.\n"


def flown_cell(hits: pd.DataFrame) -> dict[str, object]:
    found = hits[hits["found"]]
    missed, false = int((~hits["found"]).sum()), int((hits["false"] > 0).sum())
    return {
        "hits": len(hits),
        "missed": missed,
        "at most [%]": per_cent(at_most(missed, len(hits)), 2),
        "false alarms": false,
        "at most, false [%]": per_cent(at_most(false, len(hits)), 2),
        "again": int((found["again"] > 0).sum()),
        "not at rest": int(found["rest_s"].isna().sum()),
        "over": int((hits["tilt_deg"] > OVERTURNED_DEG).sum()),
        "tilt, 95 % [°]": text_of(hits["tilt_deg"].quantile(0.95), 0),
        "lost, 95 % [m]": text_of(hits["lost_m"].quantile(0.95), 2),
        "at rest after, median [s]": text_of(found["rest_s"].quantile(0.5), 2),
    }


def verdict_cell(hits: pd.DataFrame) -> dict[str, object]:
    """Hits by one vehicle are no independent ones (see `tables.at_most_of_groups`)."""
    by_vehicle = (~hits["found"]).groupby(hits["seed"]).agg(["sum", "size"])
    groups = [(int(missed), int(of)) for missed, of in by_vehicle.itertuples(index=False)]
    missed = sum(some for some, _ in groups)
    return {
        "hits": len(hits),
        "vehicles": len(groups),
        "missed": missed,
        "share [%]": per_cent(missed / len(hits) if len(hits) else math.nan, 3),
        "at most [%]": per_cent(at_most_of_groups(groups), 3),
        "vehicles with a miss": sum(some > 0 for some, _ in groups),
        "found after, median [ms]": text_of(hits["latency_ms"].quantile(0.5)),
        "95 % within [ms]": text_of(hits["latency_ms"].quantile(0.95)),
    }


def _seeds(hits: pd.DataFrame, *more: str) -> str:
    named = ["/".join(map(str, row)) for row in hits[["seed", *more, "approach"]].head(NAMED_SEEDS).to_numpy().tolist()]
    return ", ".join(named) + (", ..." if len(hits) > NAMED_SEEDS else "") or "none"
