"""`bench campaign`: random missions in random rooms with both airframes, judged by what really happened."""

from argparse import Namespace
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path

import pandas as pd

from bench.cases.missions import MissionCase, airframe_data, flyable, random_mission
from bench.cases.vehicles import AIRFRAMES
from bench.fly.campaign import Results
from bench.fly.lockstep import NOTICED_M_S, fly
from bench.rows.judge import failures, work_out_mission
from bench.rows.recovered import UNANSWERED
from bench.rows.tables import Bar, share_bar, summary_text, table
from bench.studies.study import Shown, own_airframe, run_study, seeds_of
from rebound_cli.main import build_parser
from rebound_cli.results import run_folder

AIRFRAME_AS_GIVEN = "airframe-as-given.yaml"
# The share of missions that must end as they say; of vehicles drawn at random it is another one.
MISSIONS_WANTED = {"foldable": 0.995, "rigid": 0.95}
DRAWN_WANTED = {"foldable": 0.995, "rigid": 0.99}
CLEAN_WANTED = 0.99
OVERSHOOT_MOST_M = 0.05
LOST_MOST_M, LOST_UP_TO_M_S = 0.10, 2.5
# The hits that the bars are about: 1 to 5 m/s; heights of vehicles that fly level past something upright.
HIT_SPEEDS_M_S = (1.0, 5.0)
LEVEL_M_S = 0.3
UPRIGHT = 0.7


def run_missions(options: Namespace) -> int:
    """0 when everything is written, whatever it says; 1 when a case failed to be flown."""
    is_drawn = options.vehicles == "drawn"
    own = options.airframe if is_drawn and options.only and options.airframe in AIRFRAMES else own_airframe(options)
    if options.only is not None:
        return run_only(MissionCase(options.only, own or AIRFRAMES[0], is_drawn), options.out)
    names = AIRFRAMES if own is None else (own,)
    cases = [MissionCase(seed, name, is_drawn) for seed in seeds_of(options, options.missions) for name in names]
    wanted = DRAWN_WANTED if is_drawn else MISSIONS_WANTED
    return run_study(options, "campaign", "Campaign", cases, work_out_mission, lambda results: shown(results, wanted))


def shown(results: Results, wanted: Mapping[str, float]) -> Shown:
    flights, hits = mission_rows(results), hit_rows(results)
    bars = mission_bars(flights, hits, wanted)
    parts = {"What must be shown": table(bars), **tables(flights)}
    return Shown(parts, summary_text(bars), flights)


def mission_rows(results: Results) -> pd.DataFrame:
    """One a flight."""
    frame = pd.DataFrame(results.rows())
    return frame.assign(
        hits=frame["hits"].map(len),
        is_good=~frame["failures"].map(bool),
        again=[command_again(case) for case, _ in results.found],
    )


def hit_rows(results: Results) -> pd.DataFrame:
    """One a hit, with its flight's own numbers."""
    hits = ({**asdict(case), **hit} for case, flight in results.found for hit in flight["hits"])
    return pd.DataFrame(hits).astype(dict.fromkeys(UNANSWERED, float))


def tables(flights: pd.DataFrame) -> dict[str, str]:
    """By their headings."""
    first = flights["failures"].map(lambda causes: causes[0][0] if causes else None)
    causes = pd.crosstab(first[~flights["is_good"]], flights["airframe"]).rename_axis("first cause")
    kinds = flights.groupby(["room", "stream_hz", "airframe"])["is_good"].agg(["size", "sum"])
    return {
        "Missions that did not end as they say": table(causes.reset_index()) + "\n" + failures_table(flights),
        "By room and stream: flown, and ended as they say": table(kinds.reset_index()),
    }


def failures_table(flights: pd.DataFrame) -> str:
    """Every mission that did not end as it says; the command flies it again into a run folder."""
    failed = flights[~flights["is_good"]].sort_values(["seed", "airframe"])
    said = failed["failures"].map(lambda causes: "; ".join(f"{cause}: {details}" for cause, details in causes))
    columns = failed[["seed", "airframe", "room", "stream_hz", "wind_m_s"]]
    return table(columns.assign(cause=said, again="`" + failed["again"] + "`"))


def command_again(case: MissionCase) -> str:
    """What flies a mission of the campaign again, into a run folder."""
    airframe = "" if case.airframe == AIRFRAMES[0] else f" --airframe {case.airframe}"
    drawn = " --vehicles drawn" if case.is_drawn else ""
    return f"python -m bench campaign --only {case.seed}{airframe}{drawn}"


def run_only(case: MissionCase, out: Path | None) -> int:
    """Fly it as `rebound fly --lockstep` does and say what the campaign makes of it; 0 where it ended as it says."""
    drawn = random_mission(case)
    folder = run_folder.create_run_folder(out, drawn.data["name"])
    mission = folder / run_folder.MISSION_NAME
    run_folder.write_yaml(folder / AIRFRAME_AS_GIVEN, airframe_data(case))
    sim = drawn.data["sim"] | {"airframe": str(folder / AIRFRAME_AS_GIVEN)}
    run_folder.write_yaml(mission, drawn.data | {"sim": sim})
    options = build_parser().parse_args(["fly", str(mission), "--lockstep", "--out", str(folder)])
    options.run(options)
    found = failures(fly(*flyable(case, drawn)))
    print("\n".join(": ".join(failure) for failure in found) or "It ended as it says.")
    return 1 if found else 0


# --- what must be shown


def level(hits: pd.DataFrame) -> pd.DataFrame:
    """Answered hits on something upright in level flight that met nothing else: their height is the hit's doing."""
    is_level = (hits["climbing_m_s"].abs() < LEVEL_M_S) & (hits["steepness"].abs() < UPRIGHT) & (hits["others"] == 0)
    return hits[is_level & hits["past_m"].notna()]


def mission_bars(flights: pd.DataFrame, hits: pd.DataFrame, wanted: Mapping[str, float]) -> list[Bar]:
    bars: list[Bar] = []
    for name, flown in flights.groupby("airframe", sort=False):
        what = f"{name}: missions that end as they say, without a crash"
        bars.append(share_bar(what, flown["is_good"], wanted.get(str(name))))
        bars += _hits(str(name), hits[hits["airframe"] == name])
    return bars


def _hits(airframe: str, hits: pd.DataFrame) -> Iterator[Bar]:
    fast = hits[hits["speed_m_s"].between(*HIT_SPEEDS_M_S, inclusive="left")]
    answered, is_judged = fast[fast["past_m"].notna()], airframe == "foldable"
    where, is_near = f"{airframe}, 1 to 5 m/s", answered["past_m"] <= OVERSHOOT_MOST_M
    what = f"{where}: hits without 5 cm of overshoot and without touching the surface again"
    yield share_bar(what, is_near & (answered["again"] == 0), CLEAN_WANTED if is_judged else None)
    what = f"{where}: the same, but for other guards that swing in while the vehicle leaves"
    yield share_bar(what, is_near & (answered["returned"] == 0))
    lost_m = level(hits[hits["speed_m_s"] < LOST_UP_TO_M_S])["lost_m"]
    yield share_bar(f"{airframe}, level, up to 2.5 m/s: at most 10 cm of height lost", lost_m <= LOST_MOST_M, 1.0)
    # Those that go into the surface, not along it, as fast as a detector must notice.
    into = hits[hits["closing_m_s"] >= NOTICED_M_S]
    yield share_bar(f"{airframe}: hits noticed, of those with 0.5 m/s into the surface", into["seen"])
