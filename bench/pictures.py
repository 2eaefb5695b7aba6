"""`bench pictures`: every picture of the manual, from one flight: its figure, its hit as an animation, its report."""

import shutil
import tempfile
from argparse import Namespace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from companion.errors import ReboundError
from companion.motion.rotation import body_to_ned
from rebound_cli.figure.flight import DETECTED, MEASURED
from rebound_cli.figure.ground import OBSTACLE, footprint
from rebound_cli.main import main as rebound
from rebound_cli.report.shown_flight import ShownFlight, recorded_flight
from rebound_cli.results.run_folder import FIGURE_NAME, REPORT_NAME

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
    browser_path()
    images = options.out / FOLDER
    images.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "wall"
        rebound(["fly", str(MISSION), "--lockstep", "--json", "--out", str(folder)])
        shutil.copyfile(folder / FIGURE_NAME, images / "wall.png")
        write_animation(recorded_flight(folder), images / "hit.webp")
        write_screens(folder / REPORT_NAME, images)
    print(f"Written to {images}.")
    return 0


def write_screens(page: Path, folder: Path) -> None:
    """The report as a browser shows it, at a desk and on a phone; of the hit at which the page opens."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=ARGUMENTS)
        for name, (width, height, is_dark) in SCREENS.items():
            colours: Literal["dark", "light"] = "dark" if is_dark else "light"
            opened = browser.new_page(viewport={"width": width, "height": height}, color_scheme=colours)
            opened.goto(page.resolve().as_uri())
            opened.screenshot(path=folder / name)


# --- the hit, from above, from the side and by the accelerometer

# From the first touch on: the approach, the touch, ten times slower, and the recovery.
BEFORE_S, AFTER_S, SLOW_S, SLOWNESS = 0.3, 1.8, (-0.03, 0.2), 10
# 20 in a second look smooth; each takes 7 kB.
FRAME_S = 0.05
# Shown of the surroundings of the touch, behind and beyond it and to either side: a vehicle and a half.
BEHIND_M, BEYOND_M, ASIDE_M = 0.75, 0.25, 0.45
# An arm that has folded by this share of the most in the hit is drawn as folding: what it rests at after it is less.
FOLDS = 0.1


def write_animation(flight: ShownFlight, path: Path) -> None:
    """The first hit of a simulated flight, as animated WebP."""
    times_s = [-BEFORE_S]
    while times_s[-1] < AFTER_S:
        is_slow = SLOW_S[0] <= times_s[-1] < SLOW_S[1]
        times_s.append(round(times_s[-1] + FRAME_S / (SLOWNESS if is_slow else 1), 6))
    figure, frames = Figure(figsize=(8.0, 4.6), dpi=100), []
    canvas: Any = FigureCanvasAgg(figure)
    for since_s in times_s:
        draw(figure, flight, since_s)
        canvas.draw()
        frames.append(Image.fromarray(np.array(canvas.buffer_rgba())).convert("RGB"))
    # 60 of 100: lines stay sharp, and the file is half a megabyte.
    kept: dict[str, Any] = {"duration": round(1e3 * FRAME_S), "loop": 0, "quality": 60, "method": 6}
    frames[0].save(path, save_all=True, append_images=frames[1:], **kept)


@rc_context({"font.size": 9, "axes.titlesize": 10, "axes.grid": True, "grid.alpha": 0.25})
def draw(figure: Figure, flight: ShownFlight, since_s: float) -> None:
    """The moment so long after the first touch; world axes north, east, up, the wall across the way north."""
    assert flight.truth is not None and flight.scene is not None, "a simulated flight has both"
    figure.clear()
    figure.subplots_adjust(left=0.09, right=0.97, bottom=0.12, top=0.84, wspace=0.3, hspace=0.55)
    axes: dict[str, Any] = figure.subplot_mosaic([["above", "side"], ["above", "force"]], width_ratios=(1.25, 1))
    hit, series = flight.truth.hits[0], flight.truth.series
    detected_s = (flight.hits[0].first.impact.sample_time_boot_us - hit.contact_at_boot_us) * 1e-6
    is_detected = since_s >= detected_s
    times_s, places = (series["time_boot_us"] - hit.contact_at_boot_us) * 1e-6, series["position_ned_m"] * (1, 1, -1)
    row, detected = (int(np.searchsorted(times_s, at_s, "right")) - 1 for at_s in (since_s, detected_s))
    shown = (times_s >= -BEFORE_S) & (times_s <= since_s)
    struck = next(obstacle for _, obstacle in flight.scene.obstacles() if obstacle.name == hit.obstacle)
    wall_m, touch = footprint(struck)[:, 0], np.array(hit.contact_position_ned_m) * (1, 1, -1)
    for axis, up, title, label in ((axes["above"], 1, "from above", "east"), (axes["side"], 2, "from the side", "up")):
        axis.set(xlim=(touch[0] - BEHIND_M, touch[0] + BEYOND_M), ylim=(touch[up] - ASIDE_M, touch[up] + ASIDE_M))
        axis.set(aspect="equal", xlabel="north [m]", ylabel=f"{label} [m]", title=title)
        axis.axvspan(wall_m.min(), wall_m.max(), facecolor=OBSTACLE, alpha=0.5, hatch="//")
        axis.plot(places[shown, 0], places[shown, up], zorder=1, **MEASURED)
        if is_detected:
            axis.plot(*places[detected, [0, up]], "o", color=DETECTED, markersize=7, zorder=4)
        for arm, is_folding in _arms(flight, series["attitude_wxyz"][row], series["arm_fold_m"][row]):
            at = places[row] + arm
            axis.plot(at[:2, 0], at[:2, up], color="0.2", linewidth=2.5, zorder=3)
            axis.plot(at[2:, 0], at[2:, up], color=DETECTED if is_folding else "tab:blue", linewidth=2.0, zorder=3)
    # North to the right and seen from above, east is down.
    axes["above"].invert_yaxis()
    _draw_force(axes["force"], flight, since_s, detected_s)
    said = f"hit detected after {1e3 * detected_s:.1f} ms" if is_detected else "touches the wall"
    pace = f"{SLOWNESS} times slower" if SLOW_S[0] <= since_s < SLOW_S[1] else ""
    text = f"{1e3 * since_s:6.0f} ms   {said if since_s >= 0.0 else 'on its way':<28}{pace}"
    figure.text(0.03, 0.93, text, fontsize=13, family="monospace")


def _arms(flight: ShownFlight, attitude_wxyz: Any, folds_m: Any) -> Any:
    """Of each its two ends and the ring of its guard, as long as it is now, from the centre; and whether it folds."""
    assert flight.truth is not None
    guards, most_m = flight.config.estimate.guards, FOLDS * flight.truth.hits[0].max_fold_m
    round_m = [(guards.radius_m * np.cos(a), guards.radius_m * np.sin(a)) for a in np.linspace(0.0, 2.0 * np.pi, 49)]
    # As PX4 counts the motors of a quad-x; body forward, right.
    for (ahead, aside), fold_m in zip(((1, 1), (-1, -1), (1, -1), (-1, 1)), folds_m, strict=True):
        x, y = ((guards.centre_m - fold_m) * np.sqrt(0.5) * way for way in (ahead, aside))
        places = [(0.0, 0.0), (x, y), *((x + ring_x, y + ring_y) for ring_x, ring_y in round_m)]
        turned = [body_to_ned(tuple(attitude_wxyz.tolist()), (x, y, 0.0)) for x, y in places]
        yield np.array(turned) * (1, 1, -1), fold_m > most_m


def _draw_force(axis: Any, flight: ShownFlight, since_s: float, detected_s: float) -> None:
    """Sample by sample, as the detector hears them."""
    assert flight.truth is not None
    times_ms = (flight.log.imu_time_boot_us - flight.truth.hits[0].contact_at_boot_us) * 1e-3
    force = np.hypot(*flight.log.specific_force_frd_m_s2[:, :2].T)
    window = (times_ms >= 1e3 * SLOW_S[0]) & (times_ms <= 1e3 * SLOW_S[1])
    heard = window & (times_ms <= 1e3 * since_s)
    axis.plot(times_ms[heard], force[heard], ".-", **MEASURED)
    if since_s >= detected_s:
        axis.axvline(1e3 * detected_s, color=DETECTED, linewidth=1.2)
    axis.set(xlim=(1e3 * SLOW_S[0], 1e3 * SLOW_S[1]), ylim=(0.0, 1.1 * force[window].max()))
    axis.set(title="specific force sideways", xlabel="time since the first touch [ms]", ylabel="[m/s²]")
