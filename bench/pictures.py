"""`bench pictures`: the pictures of the manual, from one flight: its report, and the hit as that shows it."""

import io
import shutil
import tempfile
from argparse import Namespace
from pathlib import Path
from typing import Any, Literal

from PIL import Image

from companion.errors import ReboundError
from rebound_cli.main import main as rebound
from rebound_cli.results.run_folder import REPORT_NAME

MISSION = Path(__file__).parents[1] / "missions" / "wall.yaml"
FOLDER = Path("docs") / "images"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# Three dimensions without a graphics card, and a browser that asks its maker for nothing. As root there is no sandbox.
ARGUMENTS = (
    *("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic"),
)
# Of each picture the window's width and height, CSS pixels, and whether a dark page is wished for.
SCREENS = {"report.png": (1280, 1000, False), "report-phone.png": (390, 844, True)}

# The hit, from the moment it is detected on: the approach, the touch, which is slower, and the recovery.
BEFORE_S, AFTER_S, SLOW_S, SLOWNESS = 0.4, 1.4, (-0.03, 0.2), 6
# 20 in a second look smooth.
FRAME_S = 0.05
# A window in which the replay is 720 by 434 pixels. It is looked at from the left, from a little behind and above, and
# what is looked at is where the vehicle is pushed back to.
WINDOW = {"width": 754, "height": 700}
VIEW = """() => {
  const hit = flight.moments.find((moment) => moment.kind === "hit");
  shown.player.seek(hit.t);
  Object.assign(shown.scene.view, { follows: false, turn: 1.1, tilt: 0.45, away: 1.2 });
  shown.scene.view.centre.z += 0.2;
  return hit.t;
}"""


class NoBrowserError(ReboundError):
    """No browser is installed."""


def browser_path() -> str:
    """Raises NoBrowserError."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise NoBrowserError("No browser is installed: apt-get install chromium (on Ubuntu: chromium-browser).")
    return found


def run_pictures(options: Namespace) -> int:
    """0 when all are written. Raises ReboundError."""
    from playwright.sync_api import sync_playwright

    browser_path()
    images = options.out / FOLDER
    images.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "wall"
        rebound(["fly", str(MISSION), "--lockstep", "--json", "--out", str(folder)])
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=browser_path(), args=ARGUMENTS)
            write_animation(browser, folder / REPORT_NAME, images / "hit.webp")
            write_screens(browser, folder / REPORT_NAME, images)
    print(f"Written to {images}.")
    return 0


def write_screens(browser: Any, page: Path, folder: Path) -> None:
    """The report as a browser shows it, at a desk and on a phone; of the hit at which the page opens."""
    for name, (width, height, is_dark) in SCREENS.items():
        colours: Literal["dark", "light"] = "dark" if is_dark else "light"
        opened = browser.new_page(viewport={"width": width, "height": height}, color_scheme=colours)
        opened.goto(page.resolve().as_uri())
        opened.screenshot(path=folder / name)


def write_animation(browser: Any, page: Path, path: Path) -> None:
    """The first hit as the report's replay shows it, as animated WebP."""
    opened, frames, since_s = browser.new_page(viewport=WINDOW, color_scheme="light"), [], -BEFORE_S
    opened.goto(page.resolve().as_uri())
    hit_s, stage = opened.evaluate(VIEW), opened.locator(".stage")
    while since_s < AFTER_S:
        opened.evaluate("(time) => shown.player.seek(time)", hit_s + since_s)
        frames.append(Image.open(io.BytesIO(stage.screenshot())).convert("RGB"))
        since_s += FRAME_S / (SLOWNESS if SLOW_S[0] <= since_s < SLOW_S[1] else 1)
    kept: dict[str, Any] = {"duration": round(1e3 * FRAME_S), "loop": 0, "quality": 70, "method": 6}
    frames[0].save(path, save_all=True, append_images=frames[1:], **kept)
