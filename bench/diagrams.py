"""`python -m bench.diagrams FILE`: writes the state diagrams and tables into a document, from the tables."""

import sys
from pathlib import Path

from bench.import_graph import package_diagram
from bench.marked import with_part
from companion.flight.states import TABLE as FLIGHT
from companion.guard.states import TABLE as GUARD
from sim_vehicle.autopilot.commander.failsafe_table import markdown_table as failsafe_table
from sim_vehicle.autopilot.modes import mode_diagram

ROOT = Path(__file__).parent.parent


def with_diagrams(text: str) -> str:
    """The document with everything between its `generated` marks made anew. Raises MarkedPartError."""
    contents = {
        "package diagram": f"```mermaid\n{package_diagram(ROOT)}```\n",
        "flight diagram": f"```mermaid\n{FLIGHT.mermaid_diagram()}```\n",
        "flight table": FLIGHT.markdown_table(),
        "guard diagram": f"```mermaid\n{GUARD.mermaid_diagram()}```\n",
        "guard table": GUARD.markdown_table(),
        "mode diagram": f"```mermaid\n{mode_diagram().rstrip()}\n```\n",
        "failsafe table": failsafe_table(),
    }
    for name, content in contents.items():
        text = with_part(text, name, content)
    return text


if __name__ == "__main__":
    document = Path(sys.argv[1])
    document.write_text(with_diagrams(document.read_text()))
