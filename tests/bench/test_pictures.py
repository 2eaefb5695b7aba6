"""The pictures of the manual: the hit's animation shows what happens, and their pages are stamped."""

import numpy as np
import pytest

from bench.main import main
from bench.pictures import command
from bench.pictures.animation import Frame
from bench.stamps import stamp_text, stamps_in
from rebound_cli.report.shown_flight import recorded_flight
from tests.rebound_cli.command import WALL, run_here


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flights") / "wall"
    run_here("fly", WALL, "--lockstep", "--json", "--out", folder)
    return recorded_flight(folder)


def red_share(frame):
    red, green, blue = np.moveaxis(np.asarray(frame).astype(int), -1, 0)
    return ((red - green > 80) & (red - blue > 80)).mean()


@pytest.mark.slow
def test_arms_turn_red_as_they_fold_and_the_moment_of_detection_stays(flight):
    hit = flight.truth.hits[0]
    before, folded, after = (red_share(Frame(flight, hit, at_s).drawn()) for at_s in (-0.1, 0.025, 1.5))
    assert before == 0.0 and folded > 3.0 * after > 0.0


@pytest.mark.slow
def test_a_command_makes_all_pictures_and_stamps_their_pages(tmp_path, monkeypatch):
    # Given pages with an old stamp of it, and one of another command
    old, other = stamp_text(command.COMMAND, ["bench/pictures"]).replace("+", "+0"), stamp_text("make bumps", ["docs"])
    (tmp_path / "README.md").write_text(f"![hit](docs/images/hit.webp)\n{old}; {other}.\n")
    monkeypatch.setattr(command, "write_animation", lambda flight, path: path.write_text(flight.name))
    monkeypatch.setattr(command, "write_screens", lambda page, folder: (folder / "report.png").write_bytes(b"x"))
    monkeypatch.setattr(command, "browser_path", lambda: "")
    assert main(["pictures", "--out", str(tmp_path)]) == 0
    images = tmp_path / command.FOLDER
    assert (images / "hit.webp").read_text() == "wall" and (images / "wall.png").stat().st_size > 10_000
    found = stamps_in((tmp_path / "README.md").read_text())
    assert [(stamp.command, stamp.is_old) for stamp in found] == [(command.COMMAND, False), ("make bumps", False)]
