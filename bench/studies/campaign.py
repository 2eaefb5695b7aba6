"""`bench campaign`: random missions in random rooms with both airframes, judged by what really happened."""

from argparse import Namespace
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import pandas as pd

from bench.cases.missions import MissionCase, airframe_data, flyable, random_mission
from bench.cases.vehicles import AIRFRAMES
from bench.fly.campaign import RECORDS_FOLDER, Campaign, CampaignError, Results, Workers, read_record, run_campaign
from bench.fly.lockstep import fly
from bench.rows.judge import failures, work_out_mission
from bench.rows.tables import Page, bars_text, summary_text, table
from bench.studies.laws import law_bars, law_table, laws_campaign
from bench.studies.laws import rows as law_rows
from bench.studies.mission_bars import DRAWN_WANTED, MISSIONS_WANTED, OVERSHOOT_MOST_M, mission_bars, noticeable
from companion.errors import ConfigurationError
from rebound_cli.main import build_parser
from rebound_cli.results import run_folder

# The first hit of every fifth mission shows what the feed-forward of the height is worth.
COMPARED_EVERY = 5
SPEED_BINS_M_S = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.5]
WIND_BINS_M_S = [0.0, 1.0, 2.0, 3.0, 4.0, 5.01]
AIRFRAME_AS_GIVEN = "airframe-as-given.yaml"
# Of the hits that are the record in one thing so many are named, with the command that flies them again.
WORST = 5
# What of a hit is compared, and whether much of it is bad.
FIGURES = {"past_m": True, "latency_ms": True, "settled_s": True, "clear_m": False}


def missions_campaign(missions: int, first_seed: int = 1, is_drawn: bool = False) -> Campaign:
    """Seeds from the first on, each with every airframe; then some again without the feed-forward of the height.

    `is_drawn`: with a vehicle drawn from each seed, of the two airframes' kinds.
    """
    seeds = range(first_seed, first_seed + missions)
    cases = [MissionCase(seed, name, is_drawn=is_drawn) for seed in seeds for name in AIRFRAMES]
    some = [seed for seed in seeds if seed % COMPARED_EVERY == 0]
    cases += [MissionCase(seed, name, False, is_drawn) for seed in some for name in AIRFRAMES]
    parameters = {"missions": missions, "first_seed": first_seed, "is_drawn": is_drawn}
    return Campaign("missions", parameters, cases, work_out_mission)


def run_missions(options: Namespace) -> int:
    """0 when everything is written, whatever it says; 1 when a case failed to be flown."""
    is_drawn = options.vehicles == "drawn"
    if options.only is not None:
        return run_only(MissionCase(options.only, options.airframe or "foldable", is_drawn=is_drawn), options.out)
    if options.airframe is not None:
        raise ConfigurationError("--airframe belongs to --only: a campaign flies every mission with both.")
    page, workers = Page(options.out, "drawn" if is_drawn else "campaign"), Workers(options.jobs, options.scheduler)
    campaign = missions_campaign(options.missions, options.first_seed, is_drawn)
    results = run_campaign(campaign, workers)
    flights, hits = mission_rows(campaign, results), hit_rows(campaign, results)
    bars = mission_bars(flights, hits, DRAWN_WANTED if is_drawn else MISSIONS_WANTED)
    parts, failed = tables(flights, hits), results.text(campaign)
    if not is_drawn:
        laws = laws_campaign(options.hits)
        flown = run_campaign(laws, workers)
        bars += law_bars(law_rows(laws, flown))
        parts["Recovery laws"] = law_table(law_rows(laws, flown))
        failed += flown.text(laws)
    page.write("Campaign", options.typed, {"What must be shown": bars_text(bars), **parts}, rows=flights)
    print(f"{summary_text(bars)}\n{failed}")
    return 1 if failed else 0


def mission_rows(campaign: Campaign, results: Results) -> pd.DataFrame:
    """One a flight."""
    found = [{**asdict(campaign.cases[at]), **one} for at, one in results.results.items()]
    frame = pd.DataFrame(found).drop(columns="hits")
    frame["hits"] = [len(one["hits"]) for one in found]
    frame["is_good"] = [not one["failures"] for one in found]
    frame["again"] = [command_again(campaign.cases[at]) for at in results.results]
    return frame


def hit_rows(campaign: Campaign, results: Results) -> pd.DataFrame:
    """One a hit, with its flight's own numbers."""
    found = [
        {**asdict(campaign.cases[at]), "hit": number, **hit}
        for at, one in results.results.items()
        for number, hit in enumerate(one["hits"])
    ]
    columns = [
        "seen",
        "again",
        "others",
        "returned",
        "past_m",
        "settled_s",
        "clear_m",
        "lost_m",
        "risen_m",
        "leant_deg",
    ]
    frame = pd.DataFrame(found)
    return frame.reindex(columns=[*frame.columns, *(name for name in columns if name not in frame.columns)])


def tables(flights: pd.DataFrame, hits: pd.DataFrame) -> dict[str, str]:
    """By their headings, of the flights with the feed-forward of the height."""
    flown, met = flights[flights["feed_forward"]], hits[hits["feed_forward"]]
    kinds = [flown["room"], "with a " + flown["extras"].explode().dropna(), flown["stream_hz"].astype(str) + " Hz"]
    kinds.append("wind " + pd.cut(flown["wind_m_s"], WIND_BINS_M_S, right=False).astype(str) + " m/s")
    by_kind = pd.concat(kinds).rename("what was drawn").to_frame().join(flown[["airframe", "is_good", "hits"]])
    ended = by_kind.groupby(["what was drawn", "airframe"], sort=False).agg(
        missions=("is_good", "size"), good=("is_good", "sum"), hits=("hits", "sum")
    )
    first = flown["failures"].map(lambda causes: causes[0][0] if causes else None)
    causes = pd.crosstab(first[~flown["is_good"]], flown["airframe"]).rename_axis("first cause")
    return {
        "Missions that did not end as they say": table(causes.reset_index()) + "\n" + failures_table(flown),
        "By room, stream and wind": table(ended.unstack().reset_index()),
        "Recoveries by speed": table(speed_rows(met)),
    }


def speed_rows(hits: pd.DataFrame) -> pd.DataFrame:
    bands = pd.cut(hits["speed_m_s"], SPEED_BINS_M_S, right=False).rename("speed [m/s]")
    found = hits.assign(
        noticed=hits["seen"].where(noticeable(hits)).astype(float), far=hits["past_m"] > OVERSHOOT_MOST_M
    ).groupby(["airframe", bands], observed=True)
    figures = found.agg(
        **{
            "hits": ("seen", "size"),
            "noticed": ("noticed", "mean"),
            "settled [s]": ("settled_s", "median"),
            "past 5 cm": ("far", "sum"),
            "past, worst [m]": ("past_m", "max"),
            "touched again": ("again", lambda counts: (counts > 0).sum()),
            "other surface": ("others", lambda counts: (counts > 0).sum()),
            "lost, worst [m]": ("lost_m", "max"),
            "gained, worst [m]": ("risen_m", "max"),
        }
    )
    return figures.round(4).reset_index()


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
    print("\n".join(f"{failure.cause}: {failure.details}" for failure in found) or "It ended as it says.")
    return 1 if found else 0


def run_page(options: Namespace) -> int:
    """What a record holds, beside another version's: bars, what has changed, and the worst hits."""
    record = options.record or _newest()
    campaign, results = _read(record)
    flights, hits = mission_rows(campaign, results), hit_rows(campaign, results)
    parts = {"What must be shown": bars_text(mission_bars(flights, hits)), **tables(flights, hits)}
    if options.against is not None:
        other, before = _read(options.against)
        old_flights, old_hits = mission_rows(other, before), hit_rows(other, before)
        parts["What must be shown, before"] = bars_text(mission_bars(old_flights, old_hits))
        parts["What has changed"] = changes(flights, old_flights)
    parts["The worst hits"] = worst(hits, flights)
    Page(options.out or record.with_suffix(".md"), "page").write(record.stem, options.typed, parts)
    return 0


def changes(flights: pd.DataFrame, before: pd.DataFrame) -> str:
    """Missions that end otherwise in the two versions."""
    keys = ["seed", "airframe", "feed_forward"]
    both = flights.merge(before, on=keys, suffixes=("", "_before"))
    other = both[both["is_good"] != both["is_good_before"]]
    words = other["is_good"].map({True: "mended", False: "new"})
    causes = other["failures"].where(~other["is_good"], other["failures_before"]).map(lambda found: found[0][0])
    return table(other[keys].assign(change=words, cause=causes, again="`" + other["again"] + "`"))


def worst(hits: pd.DataFrame, flights: pd.DataFrame) -> str:
    """Of each quantity some hits, with the command that flies them again."""
    keys = ["seed", "airframe", "feed_forward"]
    met = hits[noticeable(hits)].merge(flights[[*keys, "again"]], on=keys, suffixes=("", "_command"))
    found = []
    for key, much_is_bad in FIGURES.items():
        some = met.dropna(subset=[key]).sort_values(key, ascending=not much_is_bad).head(WORST)
        shown = some[["airframe", "speed_m_s", "bearing_deg", "kind"]]
        found.append(shown.assign(what=key, value=some[key], command="`" + some["again_command"] + "`"))
    return table(pd.concat(found))


def _read(record: Path) -> tuple[Campaign, Results]:
    """Raises CampaignError for a file that is no record of random missions."""
    try:
        head, outcomes = read_record(record)
        parameters: Mapping[str, int] = (head or {})["parameters"]
        campaign = missions_campaign(parameters["missions"], parameters["first_seed"], bool(parameters["is_drawn"]))
    except (OSError, KeyError, TypeError) as error:
        raise CampaignError(f"{record} is no record of random missions.") from error
    known = {at: one for at, one in sorted(outcomes.items()) if at < len(campaign.cases)}
    return campaign, Results({at: one.result for at, one in known.items() if one.failure is None}, {})


def _newest() -> Path:
    """Raises CampaignError where there is none."""
    found = sorted(RECORDS_FOLDER.glob("missions-*.jsonl"), key=lambda path: path.stat().st_mtime)
    if not found:
        raise CampaignError(f"No random missions are in {RECORDS_FOLDER}; `python -m bench campaign` flies some.")
    return found[-1]
