"""`bench paper`: flies every study of the paper and writes its numbers beside ours, tables and pictures."""

from argparse import Namespace

import pandas as pd
from matplotlib.figure import Figure

from bench.fly.campaign import Campaign, Workers, rows_of
from bench.rows.paper import fly
from bench.rows.tables import Page, table
from bench.studies.paper import rigid, scenarios, single, walls
from bench.studies.paper.study import Claim, sampling_text, verdict_text

STUDIES = (
    single.ARM,
    scenarios.SAMPLE,
    scenarios.EXPERIMENT,
    walls.FLIGHT_TESTS,
    rigid.WHY,
    walls.ANY_SIDE,
    rigid.SAMPLING,
    single.OTHERS,
)


def run_paper(options: Namespace) -> int:
    """Fly everything and write it. 0 when it is written, whatever it says."""
    page = Page(options.out, "paper")
    planned = [(study.title, flight) for study in STUDIES for flight in study.flights(options.seeds)]
    campaign = Campaign("paper", {"seeds": options.seeds}, [flight for _, flight in planned], fly)
    rows = pd.DataFrame(rows_of(campaign, Workers(options.jobs)))
    rows.insert(0, "study", [title for title, _ in planned])
    parts: dict[str, str] = {}
    pictures: dict[str, Figure] = {}
    claims: list[Claim] = []
    for study in STUDIES:
        flown = rows[rows["study"] == study.title]
        found = study.conclude(flown)
        parts[study.title] = (f"{sampling_text(flown)}\n\n" if len(flown) else "") + table(found.rows)
        parts |= found.tables
        pictures |= found.pictures
        claims += found.rows
    page.write("The paper's numbers beside ours", options.typed, parts, pictures, rows.drop(columns="track"))
    print(verdict_text(claims))
    return 0
