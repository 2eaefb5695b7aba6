"""`bench pictures`: every picture of the manual, from one flight."""

import shutil
import tempfile
from argparse import Namespace
from pathlib import Path

from bench.pictures.animation import write_animation
from bench.pictures.screens import browser_path, write_screens
from bench.stamps import ROOT, stamped_anew
from rebound_cli.main import main as rebound
from rebound_cli.report.shown_flight import recorded_flight
from rebound_cli.results.run_folder import FIGURE_NAME, REPORT_NAME

COMMAND = "python -m bench pictures"
MISSION = ROOT / "missions" / "wall.yaml"
FOLDER = Path("docs") / "images"
# Which pages show them.
PAGES = (Path("README.md"), Path("docs") / "how-to" / "report.md")


def run_pictures(options: Namespace) -> int:
    """0 when all are written. Raises ReboundError."""
    browser_path()
    images = options.out / FOLDER
    images.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "wall"
        rebound(["fly", str(MISSION), "--lockstep", "--json", "--out", str(folder)])
        shutil.copyfile(folder / FIGURE_NAME, images / "wall.png")
        write_animation(recorded_flight(folder), images / "hit.webp")
        write_screens(folder / REPORT_NAME, images)
    for page in PAGES:
        path = options.out / page
        if path.exists():
            path.write_text(stamped_anew(path.read_text(encoding="utf-8"), COMMAND), encoding="utf-8")
    print(f"Written to {images}.")
    return 0
