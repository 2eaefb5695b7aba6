"""The pictures of the manual: the hit's animation shows what happens, and one command makes them all."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench import pictures
from rebound_cli.report.shown_flight import recorded_flight
from tests.rebound_cli.command import WALL, run_here


@pytest.mark.slow
def test_arms_turn_red_as_they_fold_and_the_moment_of_detection_stays(tmp_path):
    def red_share(since_s):
        figure = Figure(figsize=(8.0, 4.6))
        pictures.draw(figure, flight, since_s)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        red, green, blue = np.moveaxis(np.asarray(canvas.buffer_rgba()).astype(int), -1, 0)[:3]
        return ((red - green > 80) & (red - blue > 80)).mean()

    run_here("fly", WALL, "--lockstep", "--json", "--out", tmp_path / "wall")
    flight = recorded_flight(tmp_path / "wall")
    before, folded, after = map(red_share, (-0.1, 0.025, 1.5))
    assert before == 0.0 and folded > 3.0 * after > 0.0
