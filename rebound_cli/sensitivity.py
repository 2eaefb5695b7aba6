"""How much the stop of the arms decides: single head-on hits with its two numbers changed."""

from collections.abc import Iterator

from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.physics.plant import Plant
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit

SPEEDS_M_S = (1.4, 2.0, 2.5, 4.0)
CONTACT_TIMES_S = (0.0025, 0.005, 0.01)
RESTITUTIONS = (0.3, 0.5, 0.7)

# The wall is far above the ground and met within a quarter of a second, in which a vehicle falls 0.3 m.
_HEIGHT_M = 5.0
_GAP_M = 0.05
_DURATION_S = 0.3


def head_on_hit(airframe: Airframe, speed_m_s: float) -> Hit:
    """The first hit of a level vehicle thrown square at a wall with its motors off (eq. 2 and the stop alone)."""
    wall = {"point_ned_m": [0, 0, -_HEIGHT_M], "normal_ned": [-1, 0, 0]}
    plant = Plant(airframe, Scene.model_validate({"walls": [wall]}), seed=1, keeps_path=False)
    distance_m = airframe.geometry.reach_m + _GAP_M
    plant.place((-distance_m, 0.0, -_HEIGHT_M), (speed_m_s, 0.0, 0.0))
    steps = round((_DURATION_S + distance_m / speed_m_s) * 1e6 / plant.interval_us)
    for _ in range(steps):
        plant.step(None, armed=False)
    return plant.truth.hits[0]


def stop_sensitivity_text() -> str:
    """A Markdown table: rebound speed and peak force over the stop's contact time and restitution."""
    head = "| stop: contact time, restitution |" + "".join(f" {speed:g} m/s |" for speed in SPEEDS_M_S)
    lines = [head, "|---|" + "---|" * len(SPEEDS_M_S)]
    for label, airframe in _variants():
        hits = [head_on_hit(airframe, speed_m_s) for speed_m_s in SPEEDS_M_S]
        cells = [f" {hit.rebound_speed_m_s:.2f} m/s, {hit.peak_force_n:.0f} N |" for hit in hits]
        lines.append(f"| {label} |" + "".join(cells))
    return "\n".join(lines) + "\n"


def _variants() -> Iterator[tuple[str, Airframe]]:
    airframe = load_built_in("foldable")
    for contact_time_s in CONTACT_TIMES_S:
        for restitution in RESTITUTIONS:
            data = airframe.model_dump()
            # The falling vehicle must not be turned by the wall: only the stop is to be seen.
            data["drag_n_s_m"] = 0.0
            data["surface"]["guard_friction"] = 0.0
            data["arms"]["stop"] = {"contact_time_s": contact_time_s, "restitution": restitution}
            is_default = data["arms"]["stop"] == airframe.arms.stop.model_dump()
            label = f"{1e3 * contact_time_s:g} ms, {restitution:g}" + (" (the airframe's)" if is_default else "")
            yield label, Airframe.model_validate(data)
