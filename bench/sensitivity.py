"""How much the stop of the arms decides: single head-on hits with its two numbers changed."""

from collections.abc import Iterator

from bench.head_on import head_on
from sim_vehicle.airframe import Airframe, load_built_in

SPEEDS_M_S = (1.4, 2.0, 2.5, 4.0)
CONTACT_TIMES_S = (0.0025, 0.005, 0.01)
RESTITUTIONS = (0.3, 0.5, 0.7)


def stop_sensitivity_text() -> str:
    """A Markdown table: rebound speed and peak force over the stop's contact time and restitution."""
    head = "| stop: contact time, restitution |" + "".join(f" {speed:g} m/s |" for speed in SPEEDS_M_S)
    lines = [head, "|---|" + "---|" * len(SPEEDS_M_S)]
    for label, airframe in _variants():
        hits = [head_on(airframe, speed_m_s).hit for speed_m_s in SPEEDS_M_S]
        cells = [f" {hit.rebound_speed_m_s:.2f} m/s, {hit.peak_force_n:.0f} N |" for hit in hits]
        lines.append(f"| {label} |" + "".join(cells))
    return "\n".join(lines) + "\n"


def _variants() -> Iterator[tuple[str, Airframe]]:
    airframe = load_built_in("foldable")
    for contact_time_s in CONTACT_TIMES_S:
        for restitution in RESTITUTIONS:
            data = airframe.model_dump()
            data["arms"]["stop"] = {"contact_time_s": contact_time_s, "restitution": restitution}
            is_default = data["arms"]["stop"] == airframe.arms.stop.model_dump()
            label = f"{1e3 * contact_time_s:g} ms, {restitution:g}" + (" (the airframe's)" if is_default else "")
            yield label, Airframe.model_validate(data)
