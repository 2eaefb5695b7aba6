"""What the default detector must show, line by line, with the figures and a verdict."""

from collections.abc import Sequence
from dataclasses import dataclass

from bench.paper.table import markdown

MET, MISSED, REPORTED = "met", "**missed**", "reported"


@dataclass(frozen=True, slots=True)
class Bar:
    """One line; `is_met` None where there is no bar."""

    what: str
    wanted: str
    measured: str
    is_met: bool | None
    of: str = ""

    @property
    def verdict(self) -> str:
        if self.is_met is None:
            return REPORTED
        return MET if self.is_met else MISSED


def bars_text(bars: Sequence[Bar]) -> str:
    rows = [(bar.what, bar.wanted, bar.measured, bar.verdict, bar.of) for bar in bars]
    return markdown(("what", "bar", "measured", "verdict", "of"), rows, left=5)


def summary_text(bars: Sequence[Bar]) -> str:
    """For the terminal: how many are met, and which are not."""
    judged = [bar for bar in bars if bar.is_met is not None]
    missed = [bar for bar in judged if not bar.is_met]
    lines = [f"{len(judged) - len(missed)} of {len(judged)} bars are met."]
    lines += [f"  missed: {bar.what}: wanted {bar.wanted}, measured {bar.measured} ({bar.of})" for bar in missed]
    return "\n".join(lines)
