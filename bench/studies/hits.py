"""`bench hits`: hits alone, from just before each to rest; which were missed."""

import math
from argparse import Namespace

import pandas as pd

from bench.fly.campaign import Results
from bench.fly.guarded import MOST_RECOVERY_S, OVERTURNED_DEG, draw_flown
from bench.fly.lockstep import NOTICED_M_S
from bench.rows.hits import work_out_flown
from bench.rows.tables import CONFIDENCE, at_most_an_hour, at_most_of_groups, per_cent, table, text_of
from bench.studies.study import Shown, run_study, seeds_of
from companion.errors import ConfigurationError

# Into the surface.
BANDS_M_S = [0.0, NOTICED_M_S, 1.0, 2.0, 3.0, 5.0]
# Of hits missed.
BOUND = 0.01
NAMED_SEEDS = 12
# An hour on two cores, in seconds.
TWO_CORES_S = 2 * 3600.0


def run_hits(options: Namespace) -> int:
    """0 when it is written, whatever it says; 1 when a hit failed to be flown."""
    cases = [draw_flown(seed, options.vehicles == "drawn") for seed in seeds_of(options, options.hits)]
    return run_study(options, "hits", "Hits alone", cases, work_out_flown, shown)


def shown(results: Results) -> Shown:
    flights = pd.DataFrame(results.rows())
    if not flights["touched"].any():
        raise ConfigurationError("Nothing was touched: fly more hits (--hits).")
    hits = hit_rows(flights)
    return Shown({"": lead(hits, flights), **parts(hits)}, rows=hits)


def hit_rows(flights: pd.DataFrame) -> pd.DataFrame:
    """Those in which something was touched, with a column for the band of speed."""
    hits = flights[flights["touched"]].drop(columns=["touched", "processor_s"])
    bands = pd.cut(hits["closing_m_s"], BANDS_M_S, right=False).astype(str)
    return hits.astype({"found": bool, **dict.fromkeys(("latency_ms", "again", "rest_s"), float)}).assign(band=bands)


def lead(hits: pd.DataFrame, flights: pd.DataFrame) -> str:
    false, hours = int(flights["false"].sum()), flights["seconds"].sum() / 3600.0
    return (
        f"{len(hits):,} hits, {(~hits['found']).sum():,} missed; {false} false alarms in {hours:.2f} h, at most "
        f"{at_most_an_hour(false, hours):.2f} an hour. Each vehicle begins in flight and is guarded over the wire, "
        f"until it rests ({MOST_RECOVERY_S:g} s at most). The truth judges.\n"
        f"{TWO_CORES_S * len(hits) / flights['processor_s'].sum():,.0f} an hour on two cores.\n"
    )


def parts(hits: pd.DataFrame) -> dict[str, str]:
    noticed = hits[hits["closing_m_s"] >= NOTICED_M_S]
    groups = {
        f"{kind}, {hz} Hz, {band} m/s": of for (kind, hz, band), of in hits.groupby(["airframe", "imu_hz", "band"])
    }
    groups[f"all, from {NOTICED_M_S:g} m/s on"] = noticed
    cells = {name: cell(some) for name, some in groups.items()}
    # Nothing of the kind was flown in the cell: nothing is shown of it.
    open_cells = [name for name, figures in cells.items() if float(str(figures["at most [%]"])) >= 100 * BOUND]
    by_cell = table([{"hits of": name} | figures for name, figures in cells.items()])
    return {
        "By airframe, rate and speed": f"{by_cell}\nNot shown, at {100 * CONFIDENCE:g} %, to be missed in fewer than "
        f"{100 * BOUND:g} %: {'; '.join(open_cells) or 'none'}.\n",
        "By what was met": table([{"met": met} | cell(some) for met, some in noticed.groupby("approach")]),
        "Missed at 0.5 m/s and more": _seeds(noticed[~noticed["found"]]) + "\n",
    }


def cell(hits: pd.DataFrame) -> dict[str, object]:
    """Hits by one vehicle are no independent ones (see `tables.at_most_of_groups`)."""
    by_vehicle = (~hits["found"]).groupby(hits["seed"]).agg(["sum", "size"])
    groups = [(int(missed), int(of)) for missed, of in by_vehicle.itertuples(index=False)]
    missed, latency = sum(some for some, _ in groups), hits["latency_ms"]
    found = hits[hits["found"]]
    return {
        "hits": len(hits),
        "vehicles": len(groups),
        "missed": missed,
        "share [%]": per_cent(missed / len(hits) if len(hits) else math.nan, 3),
        "at most [%]": per_cent(at_most_of_groups(groups), 3),
        "found after, median / 95 % [ms]": f"{text_of(latency.quantile(0.5))} / {text_of(latency.quantile(0.95))}",
        "false alarms": int((hits["false"] > 0).sum()),
        "again": int((found["again"] > 0).sum()),
        "not at rest": int(found["rest_s"].isna().sum()),
        "over": int((hits["tilt_deg"] > OVERTURNED_DEG).sum()),
        "tilt, 95 % [°]": text_of(hits["tilt_deg"].quantile(0.95), 0),
        "lost, 95 % [m]": text_of(hits["lost_m"].quantile(0.95), 2),
        "at rest after, median [s]": text_of(found["rest_s"].quantile(0.5), 2),
    }


def _seeds(hits: pd.DataFrame) -> str:
    """Each with what was met."""
    named = [f"{seed}/{met}" for seed, met in hits[["seed", "approach"]].head(NAMED_SEEDS).to_numpy().tolist()]
    return ", ".join(named) + (", ..." if len(hits) > NAMED_SEEDS else "") or "none"
