"""The table, a row a fault: what is injected, expected and happened, the worst of it, and the verdict."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from bench.campaign.plan import Json
from bench.faults.fault import Fault
from bench.faults.kinds.files import FileFault

PART, TITLE = "faults", "Faults and attacks"
_SHOWN = 3


@dataclass(frozen=True, slots=True)
class Row:
    fault: Fault | FileFault
    results: Sequence[Json]

    @property
    def name(self) -> str:
        return self.fault.name

    @property
    def failures(self) -> list[Json]:
        return [result for result in self.results if result["complaints"]]


def text_of(rows: Sequence[Row], under_load: Json | None, stamp: str) -> str:
    """What stands between the document's marks; `stamp` says what made it (see `bench.stamps`)."""
    flights = sum(len(row.results) for row in rows)
    failing = [row for row in rows if row.failures]
    lines = [
        "",
        f"{stamp}: {len(rows)} faults, {flights} flights and files; {len(rows) - len(failing)} rows as expected in "
        f"every one, {len(failing)} not.",
        "",
        "| fault | injected | expected | n | happened | worst | verdict |",
        "|---|---|---|---|---|---|---|",
    ]
    group = ""
    for row in rows:
        if row.fault.group != group:
            group = row.fault.group
            lines.append(f"| **{group}** | | | | | | |")
        lines.append(_line(row))
    lines += ["", *_under_load(under_load), "### What was not as expected", ""]
    for row in failing:
        counts = Counter(_cause(text) for result in row.failures for text in result["complaints"])
        lines.append(f"- **{row.name}**, {len(row.failures)} of {len(row.results)}:")
        lines += [f"  - {count} × {text}" for text, count in counts.most_common(_SHOWN)]
    return "\n".join([*lines, *([] if failing else ["Nothing."]), ""])


def _line(row: Row) -> str:
    bad = len(row.failures)
    verdict = "holds" if not bad else f"**{bad} of {len(row.results)} not**"
    happened, worst = (_files if isinstance(row.fault, FileFault) else _flights)(row.results)
    cells = (row.name, row.fault.injected, row.fault.expected.text(), len(row.results), happened, worst, verdict)
    return "| " + " | ".join(map(str, cells)) + " |"


def _files(results: Sequence[Json]) -> tuple[str, str]:
    counts = Counter(result["outcome"] for result in results)
    happened = ", ".join(f"{outcome} {count}" for outcome, count in counts.most_common())
    return happened, f"{max(result['seconds'] for result in results):.1f} s of processor time"


def _flights(results: Sequence[Json]) -> tuple[str, str]:
    whole = [result for result in results if "tilt_deg" in result]
    counts = Counter(_NAMES.get(result.get("outcome", "broken"), "broken") for result in results)
    happened = ", ".join(f"{name} {count}" for name, count in counts.most_common())
    hits = [result for result in whole if result["hit"]]
    happened += f"; hits found {sum(result['found'] for result in hits)} of {len(hits)}"
    told = (("unseen", "of them met unseen"), ("false", "counted for nothing"), ("unconfirmed", "taken back"))
    for key, words in told:
        number = sum(result.get(key, 0) for result in whole)
        happened += f", {number} {words}" if number else ""
    if not whole:
        return happened, "–"
    ground = [result["ground_m_s"] for result in whole if result["ground_m_s"] is not None]
    worst = f"tilt {max(result['tilt_deg'] for result in whole):.0f}°"
    worst += f", ground {max(ground):.2f} m/s" if ground else ""
    again = max(result["again_m_s"] for result in whole)
    return happened, worst + (f", second contact {again:.2f} m/s" if again > 0.0 else "")


_NAMES = {
    "completed": "landed",
    "aborted": "handed over",
    "failed": "fault told",
    "killed": "landed by PX4",
    "hung": "not over in 60 s",
}


def _cause(text: str) -> str:
    """Without the moment, so that the same cause counts as one; of a traceback its last line."""
    return text.strip().splitlines()[-1].partition(" at ")[0][:160]


def _early(under_load: Json) -> str:
    early = under_load["busy"]["early"] + under_load["quiet"]["early"]
    return f"{early} were answered before their sample." if early else "Nothing was detected before its sample."


def _ms(milliseconds: float) -> str:
    return f"{milliseconds:.1f} ms" if math.isfinite(milliseconds) else "more than 500 ms"


def _under_load(under_load: Json | None) -> list[str]:
    if under_load is None:
        return []
    names = {"p50": "p50", "p99": "p99", "p999": "p99.9", "most": "most"}
    return [
        "### From the hit to the setpoint under load",
        "",
        f"{under_load['hits']} hits by UDP on loopback, from when the datagram with the sample that shows the hit is "
        "sent to when the recovery setpoint has arrived; the companion is a process of its own at normal priority, "
        "paced by the real clock at 250 samples a second.",
        "",
        "| beside it | hit to setpoint | found |",
        "|---|---|---|",
        *(
            f"| {name} | {', '.join(f'{words} {_ms(under_load[key][at])}' for at, words in names.items())} "
            f"| {under_load[key]['found']} of {under_load['hits']} |"
            for key, name in (("busy", "two busy loops at normal priority"), ("quiet", "what else runs on the machine"))
        ),
        "",
        f"Two cores, load average {under_load['load']:.1f} at the end. {_early(under_load)}",
        "",
    ]
