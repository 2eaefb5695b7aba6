"""What counts as a crash, by the simulator's truth alone."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from bench.fly.lockstep import JudgedFlight
from bench.rows.phases import MissionPhase, phases_of

Floats = npt.NDArray[np.float64]

# MPC_LAND_SPEED is 0.7 m/s; half as much again is a gust. More is a fall.
LANDING_SPEED_MOST_M_S = 1.2
# On the ground: the feet, or a guard of a vehicle that leans, this near to it.
TOUCHING_M = 0.01
# In the air: the first time the feet are this high.
AIRBORNE_M = 0.3
# As a mission's own default for the vehicle itself; setpoints never lie outside.
OUTSIDE_MOST_M = 1.0


def crashes(flight: JudgedFlight) -> Iterator[tuple[str, str]]:
    """Cause and details of each kind that happened."""
    series = flight.truth.series
    time_us, height_m = series["time_boot_us"], heights_m(flight)
    tilt_deg = tilts_deg(series["attitude_wxyz"])
    if tilt_deg.max() > 90.0:
        yield "tumbled", f"leant by {tilt_deg.max():.0f} deg {flight.at(time_us[int(tilt_deg.argmax())])}"
    airborne = np.flatnonzero(height_m > AIRBORNE_M)
    if len(airborne) == 0:
        return
    touching = np.flatnonzero(height_m[airborne[0] :] < TOUCHING_M)
    if len(touching) and not tilt_deg.max() > 90.0:
        index = int(airborne[0] + touching[0])
        sink_m_s = float(series["velocity_ned_m_s"][index - 1, 2])
        if sink_m_s > LANDING_SPEED_MOST_M_S:
            yield "fell", f"reached the ground with {sink_m_s:.1f} m/s {flight.at(time_us[index])}"
        phase = phases_of(flight.events, flight.truth.epoch_at_boot_us).at(float(time_us[index]))
        if phase not in (MissionPhase.LANDING, MissionPhase.OVER):
            yield "touched the ground", f"while {phase.value} {flight.at(time_us[index])}"
    fence, start = flight.mission.fence, np.array(flight.start_ned_m)
    places = series["position_ned_m"][:: max(1, len(time_us) // 2000)] - start
    outside_m = max(fence.outside_by_m((float(n), float(e), float(d))) for n, e, d in places)
    if outside_m > OUTSIDE_MOST_M:
        yield "left the fence", f"by {outside_m:.1f} m"


def heights_m(flight: JudgedFlight) -> Floats:
    """Of the lowest part above the ground, (n,): the feet, or where the vehicle leans by more the rim of a guard."""
    series = flight.truth.series
    w, x, y, z = series["attitude_wxyz"].T
    # By how much a metre along body x and y is lower.
    along_x, along_y = np.abs(2.0 * (x * z - w * y)), np.abs(2.0 * (y * z + w * x))
    depth_m = flight.arm_m * np.sqrt(0.5) * (along_x + along_y) + flight.guard_m * np.hypot(along_x, along_y)
    heights: Floats = -series["position_ned_m"][:, 2] - np.maximum(flight.standing_m, depth_m)
    return heights


def tilts_deg(attitude_wxyz: Floats) -> Floats:
    """Between the body's down and the world's, (n,)."""
    cosine = 1.0 - 2.0 * (attitude_wxyz[:, 1] ** 2 + attitude_wxyz[:, 2] ** 2)
    tilts: Floats = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return tilts
