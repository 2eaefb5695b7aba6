"""What is drawn of a mission: legends hide no data, and every word is inside the picture."""

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from tests.rebound_cli.command import run_here


@pytest.fixture
def drawn(monkeypatch):
    """Every figure that is saved, as it is saved."""
    figures = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: figures.append(figure))
    return figures


def assert_legible(figure):
    FigureCanvasAgg(figure).draw()
    # Of each part, or one of the whole
    legends = [*figure.legends, *(axis.get_legend() for axis in figure.axes if axis.get_legend())]
    assert legends
    words = [text for axis in figure.axes for text in (axis.title, axis.xaxis.label, axis.yaxis.label)]
    for legend in legends:
        words += legend.get_texts()
        for axis in figure.axes:
            assert not legend.get_window_extent().overlaps(axis.bbox), axis.get_title()
    for text in filter(Text.get_text, words):
        # A pixel less: letters are rounded outward
        assert figure.bbox.count_contains(text.get_window_extent().padded(-1.0).corners()) == 4, text


def test_a_mission_before_it_is_flown(drawn, tmp_path):
    assert run_here("check", "patrol", "--out", tmp_path).returncode == 0
    (figure,) = drawn
    assert len(figure.axes) == 2
    assert_legible(figure)
