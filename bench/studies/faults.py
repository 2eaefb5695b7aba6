"""`bench faults`: every fault and attack by the dozen, and the table of what became of them."""

from argparse import Namespace
from collections import Counter

import pandas as pd

from bench.faults.catalogue import FLOWN, GROUPS
from bench.fly.air import ENDS
from bench.fly.campaign import Results
from bench.rows.faulted import FaultCase, work_out_fault
from bench.rows.tables import table
from bench.studies.study import Shown, run_study
from companion.errors import ConfigurationError

GROUP_OF = {fault.name: group for group, faults in GROUPS.items() for fault in faults}
_SHOWN = 3


def run_faults(options: Namespace) -> int:
    """0 when every row did what is expected of it."""
    names = [*FLOWN] if options.only is None else [options.only]
    if options.only not in (None, *FLOWN):
        raise ConfigurationError(f"--only {options.only}: there is no such fault; there are {', '.join(FLOWN)}.")
    cases = [FaultCase(seed, name) for seed in range(options.seeds) for name in names]
    return run_study(options, "faults", "Faults and attacks", cases, work_out_fault, shown)


def shown(results: Results) -> Shown:
    # The faults in the table's order.
    order = [*FLOWN].index
    rows = pd.DataFrame(results.rows()).sort_values("fault", key=lambda names: names.map(order), kind="stable")
    failing = list(rows[rows["complaints"].map(bool)]["fault"].unique())
    lead = f"{rows['fault'].nunique()} faults, {len(rows)} flights; {len(failing)} rows not as expected."
    parts = {"": f"{lead}\n\n{faults_table(rows)}", "What was not as expected": complaints(rows)}
    return Shown(parts, f"{lead} {', '.join(failing)}", rows, is_met=not failing)


def faults_table(rows: pd.DataFrame) -> str:
    """A row a fault: what is injected, expected and happened, the worst of it, and the verdict."""
    return table([_of_fault(str(name), flights) for name, flights in rows.groupby("fault", sort=False)])


def _of_fault(name: str, flights: pd.DataFrame) -> dict[str, object]:
    bad = int(flights["complaints"].map(bool).sum())
    hits = flights[flights["hit"]]
    ends = flights["outcome"].map(ENDS).value_counts(sort=False)
    happened = ", ".join(f"{end} {count}" for end, count in ends.items())
    happened += f"; hits found {hits['found'].sum()} of {len(hits)}"
    for column, words in (
        ("unseen", "of them met unseen"),
        ("false", "counted for nothing"),
        ("unconfirmed", "taken back"),
    ):
        count = int(flights[column].sum())
        happened += f", {count} {words}" if count else ""
    most = flights[["tilt_deg", "ground_m_s", "again_m_s"]].astype(float).max()
    worst = [f"tilt {most['tilt_deg']:.0f}°"]
    worst += [f"ground {most['ground_m_s']:.2f} m/s"] if flights["ground_m_s"].notna().any() else []
    worst += [f"second contact {most['again_m_s']:.2f} m/s"] if most["again_m_s"] > 0.0 else []
    return {
        "kind": GROUP_OF[name],
        "fault": name,
        "injected": FLOWN[name].injected,
        "expected": FLOWN[name].expected.text(),
        "n": len(flights),
        "happened": happened,
        "worst": ", ".join(worst) if flights["tilt_deg"].notna().any() else "–",
        "verdict": f"**{bad} of {len(flights)} not**" if bad else "holds",
    }


def complaints(rows: pd.DataFrame) -> str:
    """The commonest of each row, without the moment, so that one cause counts as one; of a traceback the last line."""
    found = []
    for name, texts in (
        rows.explode("complaints").dropna(subset="complaints").groupby("fault", sort=False)["complaints"]
    ):
        causes = Counter(text.strip().splitlines()[-1].partition(" at ")[0][:160] for text in texts)
        found += [{"fault": name, "times": count, "what": cause} for cause, count in causes.most_common(_SHOWN)]
    return table(found)
