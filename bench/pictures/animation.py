"""A hit as an animation: from above, from the side and by the accelerometer, ten times slower round the touch."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from PIL import Image

from companion.motion.rotation import body_to_ned
from rebound_cli.figure.flight import DETECTED, MEASURED
from rebound_cli.figure.ground import OBSTACLE, footprint
from rebound_cli.report.shown_flight import ShownFlight
from sim_vehicle.truth import Hit

Floats = npt.NDArray[np.float64]

# From the first touch on: the approach, the touch, slowly, and the recovery.
BEFORE_S, AFTER_S = 0.3, 1.8
SLOW_S, SLOWNESS = (-0.03, 0.2), 10
# 20 in a second look smooth; each takes 7 kB.
FRAME_S = 0.05
WIDTH_PX, HEIGHT_PX, DPI = 800, 460, 100
# Shown of the surroundings of the touch, behind and beyond it and to either side: a vehicle and a half.
VIEW_M = (0.75, 0.25, 0.45)
# An arm that has folded by this share of the most in the hit is drawn as folding: what it rests at after it is less.
FOLDS = 0.1
# Arms as PX4 counts the motors of a quad-x; body forward, right.
_ARMS = np.array([(1, 1), (-1, -1), (1, -1), (-1, 1)]) / np.sqrt(2.0)
_ARM = {"color": "0.2", "linewidth": 2.5, "solid_capstyle": "round"}


def write_animation(flight: ShownFlight, path: Path) -> None:
    """The first hit of a simulated flight, as animated WebP."""
    assert flight.truth is not None, "a simulated flight has one"
    hit = flight.truth.hits[0]
    frames = [Frame(flight, hit, since_s).drawn() for since_s in frame_times_s()]
    # 60 of 100: lines stay sharp, and the file is half a megabyte.
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=round(1e3 * FRAME_S),
        loop=0,
        quality=60,
        method=6,
    )


def frame_times_s() -> list[float]:
    """Of the flight, since the first touch."""
    times_s = [-BEFORE_S]
    while times_s[-1] < AFTER_S:
        is_slow = SLOW_S[0] <= times_s[-1] < SLOW_S[1]
        times_s.append(round(times_s[-1] + FRAME_S / (SLOWNESS if is_slow else 1), 6))
    return times_s


class Frame:
    """World axes north, east, up; the wall stands across the way north."""

    def __init__(self, flight: ShownFlight, hit: Hit, since_s: float) -> None:
        assert flight.truth is not None and flight.scene is not None, "a simulated flight has both"
        self._flight, self._hit, self._since_s = flight, hit, since_s
        series = flight.truth.series
        self._times_s = (series["time_boot_us"] - hit.contact_at_boot_us) * 1e-6
        self._places = series["position_ned_m"] * (1.0, 1.0, -1.0)
        self._row = int(np.searchsorted(self._times_s, since_s, "right")) - 1
        self._turn = tuple(series["attitude_wxyz"][self._row].tolist())
        self._folds_m = series["arm_fold_m"][self._row]
        finding = flight.hits[0]
        struck = next(obstacle for _, obstacle in flight.scene.obstacles() if obstacle.name == hit.obstacle)
        self._wall_m = (footprint(struck)[:, 0].min(), footprint(struck)[:, 0].max())
        self._detected_s = (finding.first.impact.sample_time_boot_us - hit.contact_at_boot_us) * 1e-6

    def drawn(self) -> Image.Image:
        figure = Figure(figsize=(WIDTH_PX / DPI, HEIGHT_PX / DPI), dpi=DPI)
        axes = figure.subplot_mosaic([["above", "side"], ["above", "force"]], width_ratios=(1.25, 1))
        figure.subplots_adjust(left=0.09, right=0.97, bottom=0.12, top=0.84, wspace=0.3, hspace=0.55)
        self._draw(axes["above"], 1, "from above", "east [m]")
        # North to the right and seen from above, east is down.
        axes["above"].invert_yaxis()
        self._draw(axes["side"], 2, "from the side", "up [m]")
        self._draw_force(axes["force"])
        figure.text(0.03, 0.93, self._text(), fontsize=13, family="monospace")
        drawn = io.BytesIO()
        figure.savefig(drawn, format="rgba")
        return Image.frombytes("RGBA", (WIDTH_PX, HEIGHT_PX), drawn.getvalue()).convert("RGB")

    def _text(self) -> str:
        is_slow = SLOW_S[0] <= self._since_s < SLOW_S[1]
        pace = f"{SLOWNESS} times slower" if is_slow else ""
        if self._since_s < self._detected_s:
            said = "on its way" if self._since_s < 0.0 else "touches the wall"
        else:
            said = f"hit detected after {1e3 * self._detected_s:.1f} ms"
        return f"{round(1e3 * self._since_s):6d} ms   {said:<28}{pace}"

    def _draw(self, axis: Any, up: int, title: str, label: str) -> None:
        hit_at = np.array(self._hit.contact_position_ned_m) * (1.0, 1.0, -1.0)
        behind_m, beyond_m, aside_m = VIEW_M
        across = (hit_at[0] - behind_m, hit_at[0] + beyond_m)
        axis.set(xlim=across, ylim=(hit_at[up] - aside_m, hit_at[up] + aside_m), aspect="equal")
        axis.set_title(title, fontsize=10)
        axis.set_xlabel("north [m]", fontsize=9)
        axis.set_ylabel(label, fontsize=9)
        axis.grid(alpha=0.25)
        axis.axvspan(*self._wall_m, facecolor=OBSTACLE, alpha=0.5, hatch="//")
        shown = (self._times_s >= -BEFORE_S) & (np.arange(len(self._times_s)) <= self._row)
        axis.plot(self._places[shown, 0], self._places[shown, up], zorder=1, **MEASURED)
        if self._since_s >= self._detected_s:
            at = self._places[int(np.searchsorted(self._times_s, self._detected_s))]
            axis.plot([at[0]], [at[up]], "o", color=DETECTED, markersize=7, zorder=4)
        self._draw_vehicle(axis, up)

    def _draw_force(self, axis: Any) -> None:
        """Sample by sample, as the detector hears them."""
        log = self._flight.log
        times_ms = (log.imu_time_boot_us - self._hit.contact_at_boot_us) * 1e-3
        force = np.hypot(log.specific_force_frd_m_s2[:, 0], log.specific_force_frd_m_s2[:, 1])
        first_ms, last_ms = 1e3 * SLOW_S[0], 1e3 * SLOW_S[1]
        window = (times_ms >= first_ms) & (times_ms <= last_ms)
        heard = window & (times_ms <= 1e3 * self._since_s)
        axis.plot(times_ms[heard], force[heard], ".-", **MEASURED)
        if self._since_s >= self._detected_s:
            axis.axvline(1e3 * self._detected_s, color=DETECTED, linewidth=1.2)
        axis.set(xlim=(first_ms, last_ms), ylim=(0.0, 1.1 * force[window].max()))
        axis.set_title("specific force sideways", fontsize=10)
        axis.set_xlabel("time since the first touch [ms]", fontsize=9)
        axis.set_ylabel("[m/s²]", fontsize=9)
        axis.grid(alpha=0.25)

    def _draw_vehicle(self, axis: Any, up: int) -> None:
        """Arms as long as they are now, a guard round the end of each."""
        guards, centre = self._flight.config.estimate.guards, self._places[self._row]
        for (ahead, aside), fold_m in zip(_ARMS, self._folds_m, strict=True):
            reach_m = guards.centre_m - fold_m
            end = centre + self._in_world((reach_m * ahead, reach_m * aside, 0.0))
            axis.plot([centre[0], end[0]], [centre[up], end[up]], zorder=3, **_ARM)
            colour = DETECTED if fold_m > FOLDS * self._hit.max_fold_m else "tab:blue"
            ring = [self._in_world((guards.radius_m * c, guards.radius_m * s, 0.0)) for c, s in _ROUND]
            outline = end + np.array(ring)
            axis.plot(outline[:, 0], outline[:, up], color=colour, linewidth=2.0, zorder=3)

    def _in_world(self, body_frd_m: tuple[float, float, float]) -> Floats:
        n, e, d = body_to_ned(self._turn, body_frd_m)
        return np.array((n, e, -d))


_ROUND = [(np.cos(angle), np.sin(angle)) for angle in np.linspace(0.0, 2.0 * np.pi, 49)]
