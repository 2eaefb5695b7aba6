"""`bench detectors`: every collision detector on simulated hits, by what each reported, beside the truth."""

import math
from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict

import pandas as pd

from bench.cases.hits import SPEEDS_M_S, HitCase, draw_case, vehicle_of_hit
from bench.detectors.config import BaselineConfig
from bench.fly.campaign import Json, Results
from bench.fly.wire import ASKED_HZ, FOUND_WITHIN_US, Found, HeardStep, hit_of, watch_all
from bench.rows.contacts import angle_deg
from bench.rows.tables import Bar, bar, per_cent, rms, share_bar, summary_text, table, text_of
from bench.studies.study import Shown, run_study, seeds_of
from companion.messages import ImuSample
from sim_vehicle.truth import Hit

# What the drone's own detector must show, by airframe and rate received.
DEFAULT, SLOWEST_M_S = BaselineConfig().detector, SPEEDS_M_S[0]
FOUND_BARS = {("foldable", rate): 1.0 for rate in ASKED_HZ}
FOUND_BARS |= {("rigid", 246): 1.0, ("rigid", 100): 0.995, ("rigid", 50): 0.97}
LATE_BAR = 0.01
# v_c is judged as a share of the speed from here on.
FAST_M_S, SPEED_ERROR_BAR_M_S, SPEED_ERROR_BAR = 2.0, 0.05, 0.03
SPEED_BINS_M_S = [0.3, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0]
USUAL = ("airframe", "rate")
# A force counts as above the noise floor from this many standard deviations of an IMU sample on: of ten hours at
# 250 Hz on three axes, 2.7e7 numbers, noise alone takes one above six with a probability of 0.05.
NOISE_FLOOR_SIGMAS = 6.0
# None of a hit that was not found.
OF_FOUND = ("latency_ms", "samples_late", "speed_error_m_s", "normal_error_deg")


def run_detectors(options: Namespace) -> int:
    """0 when everything is written, whatever it says; 1 when a case failed."""
    cases = [draw_case(seed, options.vehicles == "drawn") for seed in seeds_of(options, options.hits)]
    return run_study(options, "detectors", "Detection", cases, work_out_hit, shown)


def shown(results: Results) -> Shown:
    hits = rows(results)
    bars = all_bars(hits)
    return Shown({"What must be shown": table(bars), **all_tables(hits)}, summary_text(bars), hits)


def rows(results: Results) -> pd.DataFrame:
    """One for each case, rate and detector: the case's own numbers, the truth's, and what was reported."""
    found = [{"case": at, **asdict(case), **row} for at, (case, hit) in enumerate(results.found) for row in hit["rows"]]
    return pd.DataFrame(found).astype(dict.fromkeys(OF_FOUND, float))


# --- one hit


def first_possible(
    contact_m_s2: Mapping[int, float], arrived: Sequence[HeardStep], touch_boot_us: float, floor_m_s2: float
) -> tuple[int | None, list[int]]:
    """The first received sample whose averaging window holds the contact's force above the floor, by the truth; None
    where the contact fell between the samples. And when each sample arrived."""
    times, first = list[int](), None
    for step in arrived:
        stamps_heard = [sample.time_boot_us for sample in step.samples if isinstance(sample, ImuSample)]
        if not stamps_heard:
            continue
        times.append(step.time_boot_us)
        shows = any(stamp >= touch_boot_us and contact_m_s2[stamp] > floor_m_s2 for stamp in stamps_heard)
        if shows and first is None:
            first = step.time_boot_us
    return first, times


def work_out_hit(case: HitCase) -> Json:
    """Fly it once, then let every detector hear it at every rate: a row for each."""
    vehicle = vehicle_of_hit(case)
    flown = hit_of(case, vehicle.airframe)
    hit, touch_us = flown.hit, flown.hit.contact_at_boot_us
    floor_m_s2 = NOISE_FLOOR_SIGMAS * vehicle.airframe.imu.accelerometer_noise_m_s2
    truth = {"true_speed_m_s": math.hypot(*hit.impact_velocity_ned_m_s)}
    rows = []
    for rate, arrived in flown.heard.items():
        possible_us, times_us = first_possible(flown.contact_m_s2, arrived, touch_us, floor_m_s2)
        possible_ms = None if possible_us is None else 1e-3 * (possible_us - touch_us)
        for name in BaselineConfig.detectors:
            config = BaselineConfig.model_validate({**vehicle.settings, "detector": name})
            found, touches = watch_all(config, arrived)
            told = sum(touch.impact.sample_time_boot_us >= touch_us for touch in touches)
            entry = _entry(found, hit, possible_us, times_us) | {"touches": told}
            rows.append({**truth, "rate": rate, "possible_ms": possible_ms, "detector": name, **entry})
    return {"rows": rows}


def samples_late(found_boot_us: int, possible_us: int | None, times_us: Sequence[int]) -> int | None:
    """How many IMU samples the report came after the first possible one; 0: with it."""
    if possible_us is None:
        return None
    return sum(possible_us < time_us <= found_boot_us for time_us in times_us)


def _entry(found: Sequence[Found], hit: Hit, possible_us: int | None, times_us: Sequence[int]) -> Json:
    """One detector's report on one hit."""
    touch_us = hit.contact_at_boot_us
    false = sum(f.time_boot_us < touch_us for f in found)
    first = next((f for f in found if touch_us <= f.time_boot_us <= touch_us + FOUND_WITHIN_US), None)
    if first is None:
        return {"false": false, "evidence": None, **dict.fromkeys(OF_FOUND)}
    velocity, true_velocity = first.final.velocity_ned_m_s, hit.impact_velocity_ned_m_s
    return {
        "false": false,
        "latency_ms": 1e-3 * (first.time_boot_us - touch_us),
        "samples_late": samples_late(first.time_boot_us, possible_us, times_us),
        "evidence": first.first.impact.evidence.value,
        "speed_error_m_s": math.hypot(*velocity) - math.hypot(*true_velocity),
        "normal_error_deg": angle_deg(first.final.normal.direction_ned, hit.normal_ned),
    }


# --- all of them: a row a case, rate and detector


def all_tables(hits: pd.DataFrame) -> dict[str, str]:
    """By their headings; of every detector, and more of the drone's own."""
    hits = hits.assign(band=pd.cut(hits["speed_m_s"], SPEED_BINS_M_S, right=False))
    ours = hits[hits["detector"] == DEFAULT]
    return {
        "Every detector on simulated hits": by(usual(hits), "detector", *USUAL),
        "By obstacle": by(usual(ours), "approach", *USUAL),
        "By speed": by(ours, "band", *USUAL),
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


# --- what must be shown of the drone's own detector


def all_bars(hits: pd.DataFrame) -> list[Bar]:
    bars: list[Bar] = []
    for (airframe, rate), ours in hits[hits["detector"] == DEFAULT].groupby(list(USUAL)):
        bars += _hit_bars(f"{airframe}, {rate} Hz", FOUND_BARS[airframe, rate], usual(ours))
    return bars


def usual(hits: pd.DataFrame) -> pd.DataFrame:
    """At the speeds that count."""
    return hits[hits["speed_m_s"] >= SLOWEST_M_S]


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
    return bar(what, f"≤ {most:g} RMS", text_of(error, 3), is_met, f"{len(errors)} hits")
