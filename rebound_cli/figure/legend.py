"""Legends that hide nothing of the data."""

from typing import Any


def legend_below(axis: Any) -> None:
    """Below the name of the axis; a figure with a constrained layout leaves room for it."""
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, fontsize=8, frameon=False)
