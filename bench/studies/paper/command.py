"""`bench paper`: flies every study of the paper and writes its numbers beside ours, tables and pictures."""

from argparse import Namespace
from dataclasses import replace

import pandas as pd
from matplotlib.figure import Figure

from bench.fly.campaign import Results
from bench.rows.paper import fly
from bench.rows.tables import table
from bench.studies.paper import flights, rigid, single
from bench.studies.paper.study import Claim, verdict_text
from bench.studies.study import Shown, run_study

STUDIES = (
    single.ARM,
    flights.SAMPLE,
    flights.EXPERIMENT,
    flights.FLIGHT_TESTS,
    rigid.WHY,
    rigid.SAMPLING,
    single.OTHERS,
)


def run_paper(options: Namespace) -> int:
    """Fly everything and write it. 0 when it is written, whatever it says."""
    planned = [replace(flight, study=study.title) for study in STUDIES for flight in study.flights()]
    return run_study(options, "paper", "The paper's numbers beside ours", planned, fly, shown)


def shown(results: Results) -> Shown:
    rows = pd.DataFrame([row for _, row in results.found])
    parts: dict[str, str] = {}
    pictures: dict[str, Figure] = {}
    claims: list[Claim] = []
    for study in STUDIES:
        flown = rows[rows["study"] == study.title]
        found = study.conclude(flown)
        parts[study.title] = table(found.rows)
        parts |= found.tables
        pictures |= found.pictures
        claims += found.rows
    return Shown(parts, verdict_text(claims), rows.drop(columns="track"), pictures)
