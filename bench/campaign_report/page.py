"""`bench campaign page`: random missions as one page, alone or against another version's."""

import base64
import html
from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.campaign.record import RecordError, outcomes_in
from bench.campaign.run import RECORDS_FOLDER
from bench.campaign_report.flown import FlownCase, Missions, square
from bench.campaign_report.mission_bars import DRAWN_WANTED, MISSIONS_WANTED, mission_bars
from bench.campaign_report.multiples import FIGURES, multiples_svg
from bench.campaign_report.tables import command_again
from bench.detectors_report.bars import Bar
from bench.random_missions.campaign import missions_campaign
from bench.random_missions.generator import AIRFRAMES, MissionCase
from companion.shell.files import write_whole

NAME = "missions"
# Hits that are named of each quantity: as many as anybody looks at.
_WORST = 3

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; img-src data:">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>
body {{ font: 15px/1.45 system-ui, sans-serif; margin: 1.5rem auto; max-width: 80rem; padding: 0 1rem }}
table {{ border-collapse: collapse; display: block; overflow-x: auto }}
th, td {{ border-bottom: 1px solid #8886; padding: .25rem .6rem; text-align: left; vertical-align: top }}
h1 {{ overflow-wrap: anywhere }}
img {{ background: white; width: 100% }}
code {{ user-select: all }}
.missed {{ font-weight: bold }}
</style>
</head>
<body>
{body}
</body>
</html>
"""


@dataclass(frozen=True, slots=True)
class Version:
    """What a record holds: missions that were flown, and why others could not be."""

    name: str
    missions: Missions
    not_flown: Mapping[MissionCase, str]

    @property
    def flown(self) -> dict[MissionCase, FlownCase]:
        """Those that a command flies again: not the second flights, without the feed-forward of the height."""
        numbered = [(self.missions.cases[number], result) for number, result in self.missions.results.items()]
        return {case: FlownCase(case, result) for case, result in numbered if case.feed_forward}


def run_page(options: Namespace) -> int:
    """Raises RecordError, OSError."""
    record = options.record or _newest()
    print(f"Written to {write_page(record, options.against, options.out)}.")
    return 0


def write_page(record: Path, against: Path | None = None, out: Path | None = None) -> Path:
    """Beside the record where no file is named. Raises RecordError, OSError."""
    out = out or record.with_suffix(".html")
    write_whole(out, page(read_version(record), None if against is None else read_version(against)).encode())
    return out


def _newest() -> Path:
    records = sorted(RECORDS_FOLDER.glob(f"{NAME}-*.jsonl"), key=lambda path: path.stat().st_mtime)
    if not records:
        raise RecordError(f"No random missions are in {RECORDS_FOLDER}; `python -m bench campaign` flies some.")
    return records[-1]


def read_version(record: Path) -> Version:
    head, outcomes = outcomes_in(record)
    if head is None or head.get("campaign") != NAME:
        raise RecordError(f"{record} holds no random missions; give one named {NAME}-....jsonl.")
    try:
        cases = missions_campaign(**head["parameters"]).cases
        results = {number: one.result for number, one in sorted(outcomes.items()) if one.result is not None}
        failed = {cases[number]: str(one.failure) for number, one in outcomes.items() if one.result is None}
        return Version(str(head["version"]), Missions(cases, results), failed)
    except (TypeError, IndexError, KeyError) as error:
        raise RecordError(f"{record} was written by a version whose campaigns this one does not know.") from error


def page(version: Version, other: Version | None = None) -> str:
    """The whole file; the same bytes for the same records."""
    counts = [_counts_text(version, airframe) for airframe in AIRFRAMES]
    title = f"Random missions, {version.name}: {', '.join(counts)}"
    versions = {version.name: version.missions}
    versions |= {} if other is None else {f"{other.name}, before": other.missions}
    parts = [f"<h1>{html.escape(title)}</h1>"]
    if other is not None:
        before = ", ".join(_counts_text(other, airframe) for airframe in AIRFRAMES)
        parts.append(f"<p>{html.escape(f'Compared with {other.name}: {before}.')}</p>")
    parts += ["<h2>What must be shown</h2>", _bars(version, other), "<h2>Every hit</h2>"]
    parts += ["<p>Hits of 0.5 m/s and more into a surface, by the simulator's truth. One dot is one hit.</p>"]
    for key, (name, *_) in FIGURES.items():
        picture = base64.b64encode(multiples_svg(key, versions).encode()).decode()
        parts.append(f'<img alt="{html.escape(name)}" src="data:image/svg+xml;base64,{picture}">')
    parts += ["<h2>The worst of them</h2>", _worst(version)]
    parts += ["<h2>Missions that did not end as they say</h2>", _failures(version, other)]
    return _PAGE.format(title=html.escape(title), body="\n".join(parts))


def _counts_text(version: Version, airframe: str) -> str:
    flown = version.missions.of(airframe)
    return f"{airframe} {sum(one.is_good for one in flown)} of {len(flown)} as they say"


def _bars(version: Version, other: Version | None) -> str:
    head, rows = ["what", "bar", "measured", "verdict", "of"], [_bar_cells(bar) for bar in _bars_of(version)]
    if other is not None:
        head.append("before")
        before = {bar.what: bar for bar in _bars_of(other)}
        rows = [[*row, before[row[0]].measured if row[0] in before else ""] for row in rows]
    return _table(head, rows)


def _bars_of(version: Version) -> list[Bar]:
    is_drawn = any(case.is_drawn for case in version.missions.cases)
    return mission_bars(version.missions, DRAWN_WANTED if is_drawn else MISSIONS_WANTED)


def _bar_cells(bar: Bar) -> list[str]:
    return [bar.what, bar.wanted, bar.measured, bar.verdict.strip("*"), bar.of]


def _worst(version: Version) -> str:
    """Of each quantity some hits, with the command that flies them again."""
    hits = [(case, hit) for case, one in version.flown.items() for hit in square(one.result["hits"])]
    rows = []
    for key, (name, unit, scale) in FIGURES.items():
        known = [(case, hit) for case, hit in hits if hit.get(key) is not None]
        # Near to what was hit is bad; of everything else much is.
        worst = sorted(known, key=lambda pair: pair[1][key], reverse=key != "clear_m")[:_WORST]
        rows += [
            [
                *(name, f"{scale * hit[key]:.1f} {unit}", case.airframe, f"{hit['speed_m_s']:.1f} m/s"),
                *(f"{hit['bearing_deg']:.0f}°" if "bearing_deg" in hit else "", str(hit["kind"]), command_again(case)),
            ]
            for case, hit in worst
        ]
    return _table(["what", "how much", "airframe", "speed", "bearing", "on", "again"], rows, code=6)


def _failures(version: Version, other: Version | None) -> str:
    """Those of either version, the newly failed first; each with the command that flies it again."""
    now, before = version.flown, {} if other is None else other.flown
    failed = [case for case in {**now, **before} if _is_bad(now.get(case)) or _is_bad(before.get(case))]
    rows = [_failure_cells(case, now.get(case), before.get(case), other is not None) for case in failed]
    rows += [
        [str(case.seed), case.airframe, "", "", f"could not be flown: {why}", command_again(case), ""]
        for case, why in version.not_flown.items()
    ]
    if not rows:
        return "<p>None.</p>"
    head = ["seed", "airframe", "room", "stream, wind", "cause", "again", "against the other version"]
    return _table(head, sorted(rows, key=lambda row: (row[6] != "new", int(row[0]))), code=5)


def _is_bad(flown: FlownCase | None) -> bool:
    return flown is not None and not flown.is_good


def _failure_cells(case: MissionCase, now: FlownCase | None, before: FlownCase | None, is_compared: bool) -> list[str]:
    shown = now if now is not None and not now.is_good else before
    assert shown is not None, "it failed in one of the two"
    result = shown.result
    causes = "; ".join(f"{cause}: {details}" for cause, details in result["failures"])
    stream = f"{result['stream_hz']} Hz, {result['wind_m_s']:.1f} m/s"
    change = ""
    if is_compared:
        change = "mended" if now is not None and now.is_good else "not flown now" if now is None else "new"
        change = "as before" if _is_bad(now) and _is_bad(before) else change
    return [str(case.seed), case.airframe, str(result["room"]), stream, causes, command_again(case), change]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], code: int | None = None) -> str:
    """Whatever is in a cell is text; those of one column are to be copied."""
    return "<table>\n" + "\n".join([_row("th", head, None), *(_row("td", row, code) for row in rows)]) + "\n</table>"


def _row(tag: str, cells: Sequence[str], code: int | None) -> str:
    def shown() -> Iterator[str]:
        for number, cell in enumerate(cells):
            text = html.escape(cell)
            kind = ' class="missed"' if cell in ("missed", "new") else ""
            yield f"<{tag}{kind}>{f'<code>{text}</code>' if number == code else text}</{tag}>"

    return f"<tr>{''.join(shown())}</tr>"
