"""`python -m bench paper`: flies every study and writes pictures, table and results of build/paper.md."""

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from bench.marked import checked_text, write_part
from bench.paper.arguments import DEFAULT_SEEDS
from bench.paper.flights import fly
from bench.paper.studies import (
    arm,
    causes,
    claims,
    directions,
    flight_tests,
    imu_rate,
    sample_scenario,
    simulation_experiment,
)
from bench.paper.study import Study, StudyFindings, concluded
from bench.paper.table import ClaimRow, rows_text
from bench.places import make_folder
from bench.processes import in_processes
from bench.stamps import stamp_text

STUDIES: tuple[Study, ...] = (
    arm,
    sample_scenario,
    simulation_experiment,
    flight_tests,
    causes,
    directions,
    imu_rate,
    claims,
)

DOCUMENT_NAME, PICTURES_FOLDER = "paper.md", Path("images") / "paper"
PART, TITLE = "paper results", "Results"


def run_paper(options: Namespace) -> int:
    """Fly everything and write it. 0 when it is written, whatever it says."""
    make_folder(options.out)
    checked_text(options.out / DOCUMENT_NAME, PART, TITLE)
    planned = [study.flights(options.seeds) for study in STUDIES]
    results = in_processes(fly, [flight for flights in planned for flight in flights], options.jobs)
    findings, first = [], 0
    for study, flights in zip(STUDIES, planned, strict=True):
        findings.append(concluded(study, results[first : first + len(flights)]))
        first += len(flights)
    write(options.out, findings, options.seeds)
    rows = [row for found in findings for row in found.rows]
    print(verdict_text(rows))
    print(f"Written to {options.out / DOCUMENT_NAME} and {options.out / PICTURES_FOLDER}.")
    return 0


def verdict_text(rows: Sequence[ClaimRow]) -> str:
    """How many rows agree, and which do not."""
    judged = [row for row in rows if row.is_judged]
    differing = [row for row in judged if not row.agrees]
    lines = [f"{len(judged) - len(differing)} of {len(judged)} of the paper's numbers agree with ours."]
    lines += [f"  differs: {row.claim}: paper {row.paper}, ours {row.ours:.3g} {row.unit}" for row in differing]
    return "\n".join(lines)


def write(folder: Path, findings: Sequence[StudyFindings], seeds: int) -> None:
    """Pictures beside the document; its result section made anew, the rest left as it is. Raises MarkedPartError."""
    pictures = folder / PICTURES_FOLDER
    pictures.mkdir(parents=True, exist_ok=True)
    for found in findings:
        for name, figure in found.pictures.items():
            figure.savefig(pictures / name)
    write_part(folder / DOCUMENT_NAME, PART, results_text(findings, seeds), TITLE)


def results_text(findings: Sequence[StudyFindings], seeds: int) -> str:
    """Markdown: the table of all rows first, then each study."""
    rows = [row for found in findings for row in found.rows]
    differing = [row for row in rows if row.is_judged and not row.agrees]
    option = "" if seeds == DEFAULT_SEEDS else f" --seeds {seeds}"
    parts = [
        f"{stamp_text(f'python -m bench paper{option}')}. Detector `lateral`, law `paper`, "
        "γ = 0.5; the vehicle knows itself by flow, range and its own Kalman filter ([estimator.md](estimator.md)).\n",
        f"{sum(row.is_judged for row in rows)} rows have a verdict; {len(differing)} differ, each with its reason in "
        "the remark or in its study below.\n",
    ]
    parts += [f"### Table: {found.title}\n\n{found.sampling}\n\n{rows_text(found.rows)}" for found in findings]
    parts += [f"## {found.title}\n\n{found.text}" for found in findings]
    return "\n" + "\n".join(parts) + "\n"
