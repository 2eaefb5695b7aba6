"""`bench paper`: flies every study of the paper and writes its numbers beside ours, tables and pictures."""

from argparse import Namespace

from matplotlib.figure import Figure

from bench.fly.campaign import Workers, worked_out
from bench.rows.tables import Page
from bench.studies.paper import arm, causes, directions, flight_tests, imu_rate, scenarios, single
from bench.studies.paper.claims import ClaimRow, rows_text, verdict_text
from bench.studies.paper.flights import fly
from bench.studies.paper.study import Study, sampling_text

STUDIES: tuple[Study, ...] = (
    arm,
    scenarios.SAMPLE,
    scenarios.EXPERIMENT,
    flight_tests,
    causes,
    directions,
    imu_rate,
    single,
)


def run_paper(options: Namespace) -> int:
    """Fly everything and write it. 0 when it is written, whatever it says."""
    page = Page(options.out, "paper")
    planned = [study.flights(options.seeds) for study in STUDIES]
    results = worked_out(fly, [flight for flights in planned for flight in flights], Workers(options.jobs))
    parts: dict[str, str] = {}
    pictures: dict[str, Figure] = {}
    rows: list[ClaimRow] = []
    for study, flights in zip(STUDIES, planned, strict=True):
        flown, results = results[: len(flights)], results[len(flights) :]
        found = study.conclude(flown)
        parts[found.title] = f"{sampling_text(flown)}\n\n{rows_text(found.rows)}" if flown else rows_text(found.rows)
        parts |= found.tables
        pictures |= found.pictures
        rows += found.rows
    page.write("The paper's numbers beside ours", options.typed, parts, pictures)
    print(verdict_text(rows))
    return 0
