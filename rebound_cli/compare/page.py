"""The comparison as one page: a chart of each figure, whose points open their flights' reports, and the table."""

import html
import io
import statistics
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from matplotlib.figure import Figure

from rebound_cli.compare.rows import NOTE, Row, lines_of

CHARTS = {
    "at_rest_after_s": "at rest after the hit [s]",
    "height_lost_m": "height lost [m]",
    "second_touches": "second touches",
    "stopped_off_m": "stopped off what was hit [m]",
}
_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 16px sans-serif; margin: 1rem auto; max-width: 72rem; padding: 0 1rem }}
td {{ padding: 0.2rem 0.8rem }} tr:nth-child(even) {{ background: #eee }} svg {{ width: 100%; height: auto }}
</style></head><body><h1>{title}</h1>
<p>Each point is a flight and opens its report. The cross is the median.</p>
{charts}<table>{table}</table><p>{note}</p></body></html>
"""


def write_page(path: Path, title: str, rows: Sequence[Row]) -> None:
    cells = ("".join(f"<td>{html.escape(cell)}</td>" for cell in line) for line in lines_of(rows))
    table = "".join(f"<tr>{line}</tr>" for line in cells)
    page = _PAGE.format(title=html.escape(title), charts=_charts(rows), table=table, note=NOTE)
    path.write_text(page, encoding="utf-8")


def _charts(rows: Sequence[Row]) -> str:
    """As SVG, to stand in the page."""
    figure = Figure(figsize=(12, 8), layout="constrained")
    laws = list(dict.fromkeys(row.law for row in rows))
    for axis, (name, label) in zip(figure.subplots(2, 2).flat, CHARTS.items(), strict=True):
        for _, some in groupby(rows, key=lambda row: row.group):
            flights = [row for row in some if None not in (row.impact_speed_m_s, getattr(row, name))]
            if not flights:
                continue
            speeds, figures = [row.impact_speed_m_s or 0.0 for row in flights], [getattr(row, name) for row in flights]
            # Above grid and crosses, which would be pressed in its place.
            law = flights[0].law
            colour = f"C{laws.index(law)}"
            points = axis.scatter(speeds, figures, s=25, color=colour, label=law or "as written", zorder=3)
            points.set_urls([row.report for row in flights])
            axis.plot(statistics.median(speeds), statistics.median(figures), "+", color=colour, markersize=14)
        axis.set_xlabel("speed of the hit [m/s]")
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    handles, labels = figure.axes[2].get_legend_handles_labels()
    of_law = dict(zip(labels, handles, strict=True))
    figure.legend(of_law.values(), of_law.keys(), loc="outside lower center", ncols=len(laws))
    text = io.StringIO()
    figure.savefig(text, format="svg")
    return text.getvalue().partition("<!DOCTYPE")[2].partition(">")[2]
