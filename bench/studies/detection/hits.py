"""`bench hits`: hits alone, from just before each to rest; which were missed."""

import math
from argparse import Namespace
from time import process_time

import numpy as np
import pandas as pd

from bench.cases.hits import HitCase
from bench.fly.campaign import Json, Results
from bench.fly.guarded import MOST_RECOVERY_S, OVERTURNED_DEG, draw_flown, fly
from bench.fly.lockstep import NOTICED_M_S
from bench.fly.wire import FOUND_WITHIN_US
from bench.rows.contacts import tilts_deg
from bench.rows.recovered import CAME_BACK_M
from bench.rows.tables import CONFIDENCE, at_most_an_hour, at_most_of_groups, per_cent, table, text_of
from bench.studies.study import Shown, own_airframe, run_study, seeds_of
from companion.errors import ConfigurationError
from companion.reflex.recovery.collision import CollisionReport
from rebound_cli.results.truth_match import LATE_SAMPLE_US, FlightTruth
from rebound_cli.simulation.lockstep import EPOCH_US
from sim_vehicle.truth import Hit
from sim_vehicle.vehicle import SimulatedVehicle

# Into the surface.
BANDS_M_S = [0.0, NOTICED_M_S, 1.0, 2.0, 3.0, 5.0]
# Of hits missed.
BOUND = 0.01
NAMED_SEEDS = 12
# An hour on two cores, in seconds.
TWO_CORES_S = 2 * 3600.0


def run_hits(options: Namespace) -> int:
    """0 when it is written, whatever it says; 1 when a hit failed to be flown."""
    airframe, is_drawn = own_airframe(options), options.vehicles == "drawn"
    cases = [draw_flown(seed, is_drawn, airframe) for seed in seeds_of(options, options.hits)]
    return run_study(options, "hits", "Hits alone", cases, work_out_flown, shown)


# --- one hit


def work_out_flown(case: HitCase) -> Json:
    """Its row by the simulator's truth, and what it cost."""
    began_s = process_time()
    vehicle, guard, rest_us = fly(case)
    processor_s = round(process_time() - began_s, 4)
    return {"processor_s": processor_s, **judged(vehicle, guard.core.collisions(), rest_us)}


def judged(vehicle: SimulatedVehicle, told: tuple[CollisionReport, ...], rest_us: int | None) -> Json:
    """Found: the companion told of the first contact, or of one that a guard's bounce made soon after."""
    hits, series = vehicle.truth.hits_so_far(), vehicle.truth.series()
    false = sum(not any(_tells_of(hit, collision) for hit in hits) for collision in told)
    result: Json = {"seconds": round(1e-6 * vehicle.time_boot_us, 3), "false": false, "touched": bool(hits)}
    if not hits:
        return result
    first = hits[0]
    touched_us = first.contact_at_boot_us
    after = series["time_boot_us"] >= touched_us
    late_us = [c.sample_time_boot_us - touched_us for c in told if c.sample_time_boot_us >= touched_us]
    is_found = bool(late_us) and late_us[0] <= FOUND_WITHIN_US
    result |= {
        "found": is_found,
        "closing_m_s": round(first.closing_speed_m_s, 3),
        "tilt_deg": round(float(tilts_deg(series["attitude_wxyz"][after]).max()), 1),
        "lost_m": round(max(0.0, float(series["position_ned_m"][after, 2].max()) - first.contact_position_ned_m[2]), 3),
        "rest_s": None if rest_us is None else round(1e-6 * (rest_us - touched_us), 3),
        "latency_ms": None,
        "again": None,
    }
    if is_found:
        until_s = MOST_RECOVERY_S if rest_us is None else 1e-6 * (rest_us - touched_us)
        result["latency_ms"] = round(1e-3 * late_us[0], 1)
        result["again"] = returns(FlightTruth(hits, series, EPOCH_US), np.array(first.normal_ned), until_s)
    return result


def _tells_of(hit: Hit, collision: CollisionReport) -> bool:
    """While the contact lasts, or as soon after its first touch as the detectors' bench calls it found."""
    until_us = max(hit.ended_at_boot_us + LATE_SAMPLE_US, hit.contact_at_boot_us + FOUND_WITHIN_US)
    return hit.contact_at_boot_us <= collision.sample_time_boot_us <= until_us


def returns(truth: FlightTruth, normal: np.ndarray, until_s: float) -> int:
    """Touches in the recovery to which the centre had come back; the others are another guard swinging in."""
    hit, time_us = truth.hits[0], truth.series["time_boot_us"]
    off_m = truth.series["position_ned_m"] @ normal
    returned = 0
    for touch in truth.hits[1:]:
        if touch.contact_at_boot_us > hit.contact_at_boot_us + 1e6 * until_s:
            break
        between = off_m[(time_us >= hit.ended_at_boot_us) & (time_us <= touch.contact_at_boot_us)]
        returned += len(between) > 0 and float(between.max() - between[-1]) > CAME_BACK_M
    return returned


# --- all of them


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
    # Each with what was met.
    missed = noticed[~noticed["found"]][["seed", "approach"]].head(NAMED_SEEDS)
    named = [f"{seed}/{met}" for seed, met in missed.to_numpy().tolist()]
    # Nothing of the kind was flown in the cell: nothing is shown of it.
    open_cells = [name for name, figures in cells.items() if float(str(figures["at most [%]"])) >= 100 * BOUND]
    by_cell = table([{"hits of": name} | figures for name, figures in cells.items()])
    return {
        "By airframe, rate and speed": f"{by_cell}\nNot shown, at {100 * CONFIDENCE:g} %, to be missed in fewer than "
        f"{100 * BOUND:g} %: {'; '.join(open_cells) or 'none'}.\n",
        "By what was met": table([{"met": met} | cell(some) for met, some in noticed.groupby("approach")]),
        "Missed at 0.5 m/s and more": f"{', '.join(named) or 'none'}\n",
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
