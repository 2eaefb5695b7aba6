"""The moments of a flight that are worth a microscope: hits, touches that were none, hits nobody saw, the closest call.

Each with what was measured and, in words, why it was a hit or why it was none.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from companion.messages import Vector3
from companion.motion.config import SHOWN_US
from companion.reflex.detection.detector import Evidence, ImpactKind, Phase
from companion.reflex.surface import Normal
from rebound_cli.replay.listening import PHASES, Tested
from rebound_cli.replay.report import SIGNS, bearing, impact_facts, kind_text, lasting_text, speed_text
from rebound_cli.replay.watching import Finding
from rebound_cli.report.shown_flight import ShownFlight
from rebound_cli.results.ending import impact_text
from rebound_cli.results.flight_log import Floats

if TYPE_CHECKING:
    from sim_vehicle.truth import Hit

# A page of more is read by nobody, and 40 of them at PX4's fastest stream are still half a megabyte.
MOST_MOMENTS = 40
# What a contact shakes belongs to it: an estimate swings for so long after one (`SHOWN_US` and a recovery).
_BESIDE_US = 500_000


@dataclass(frozen=True, slots=True)
class Moment:
    """`at_us` on the log's clock, `boot_us` on the vehicle's; `contact` what is drawn of it."""

    kind: str  # hit, contact, missed or closest
    title: str
    at_us: float
    boot_us: float
    facts: Sequence[tuple[str, str]]
    reasons: Sequence[str]
    position_ned_m: Vector3 | None = None
    normal_ned: Vector3 | None = None
    normal_error_deg: float = 0.0
    touched_boot_us: float | None = None  # the first touch, as the simulator knows it


def moments_of(flight: ShownFlight) -> list[Moment]:
    """In the order of time."""
    found = [_impact(flight, finding) for finding in flight.findings.impacts[:MOST_MOMENTS]]
    found += _missed(flight)[: MOST_MOMENTS - len(found)]
    closest = _closest(flight, [moment.boot_us for moment in found])
    return sorted([*found, *closest], key=lambda moment: moment.at_us)


# --- impacts ----------------------------------------------------------------------------------------------------


def _impact(flight: ShownFlight, finding: Finding) -> Moment:
    first = finding.first
    boot_us = first.impact.sample_time_boot_us
    touch, touched_us = flight.contact_of(finding), None
    normal = _normal(flight, finding)
    kind, what = "hit" if finding.is_collision else "contact", kind_text(finding)
    facts = impact_facts(finding, normal, flight.seconds)
    if touch is not None and flight.truth is not None:
        # As `detection_latency_ms` of the summary and the end of the flight in words have it.
        began_us = flight.truth.at_us(touch.contact_at_boot_us)
        late_ms = (finding.at_us - began_us) / 1e3
        touched_us = flight.truth.told_us(touch.contact_at_boot_us)
        hit = impact_text(touch.kind, touch.impact_velocity_ned_m_s)
        facts.append(("Simulator", f"{hit}, from {flight.seconds(began_us):.4f} s on, seen after {late_ms:.1f} ms"))
        facts.append(("Simulator's normal", bearing(touch.normal_ned)))
        # The shorter the stop's contact, the larger.
        stop = "" if flight.stop_s is None else f", by the airframe's arms.stop of {1e3 * flight.stop_s:g} ms"
        facts.append(("Simulator's largest force", f"{touch.peak_force_n:.0f} N{stop}"))
    return Moment(
        kind=kind,
        title=f"{what.capitalize()} at {speed_text(finding)}" if kind == "hit" else f"Touched, no collision: {what}",
        at_us=finding.at_us,
        boot_us=boot_us,
        facts=facts,
        reasons=list(_reasons(flight, finding, touch)),
        position_ned_m=first.position_ned_m,
        normal_ned=normal.direction_ned,
        normal_error_deg=math.degrees(normal.error_rad),
        touched_boot_us=touched_us,
    )


def _normal(flight: ShownFlight, finding: Finding) -> Normal:
    """As the memory of this touch has it; before one is made, by the contact alone."""
    for patch in flight.patches:
        if patch.found_at_us == finding.at_us and len(patch.touches_ned_m) == 1:
            return Normal(patch.normal_ned, patch.normal_error_rad)
    return finding.final.normal


def _reasons(flight: ShownFlight, finding: Finding, touch: "Hit | None") -> Iterator[str]:
    """Sign by sign, then what else it could have been."""
    impact, situation = finding.first.impact, finding.situation
    tested, may_be_hand = flight.findings.listener.shown.get(impact.sample_time_boot_us, (None, False))
    if tested is not None:
        yield from _signs(tested)
    if impact.evidence is Evidence.SUSTAINED:
        yield f"What the thrust should do and does not: {lasting_text(finding.first)}."
    if situation.descent_commanded:
        height = "an unknown height" if situation.height_m is None else f"{situation.height_m:.2f} m"
        yield f"A landing: thinkable, the vehicle was told to go down, at {height}."
    else:
        yield "A landing: no, nobody had told the vehicle to go down."
    if tested is not None:
        yield _hand_text(flight, finding, may_be_hand)
    kind = finding.final.impact.kind
    is_hit = finding.is_collision and not finding.is_crash
    yield f"Verdict: {kind.value}, {'a collision, to be recovered from' if is_hit else 'nothing to recover from'}."
    if finding.final.is_lower_bound:
        yield "Part of it was not measured, such as beyond the sensor's range: it was at least as hard as stated."
    taken_back_us = flight.taken_back_us(finding)
    if taken_back_us is not None:
        yield f"Taken back {(taken_back_us - finding.at_us) / 1e3:.0f} ms later: nothing else bore it out."
    if flight.truth is not None and touch is None and finding.is_collision:
        yield "The simulator: a false alarm, no new contact."


def _signs(tested: Tested) -> Iterator[str]:
    for sign, (value, limit) in tested.signs.items():
        name, unit, digits = SIGNS[sign]
        if value < 0.0:
            yield f"{name}: within what the propellers can do: says nothing."
        elif not math.isnan(value):
            says = "speaks for a contact" if value >= limit else "says nothing by itself"
            needed = f"a hit from {limit:.{digits}f} on ({value / limit:.1f} times)"
            yield f"{name}: {value:.{digits}f} {unit}, {needed}: {says}."


def _hand_text(flight: ShownFlight, finding: Finding, may_be_hand: bool) -> str:
    if not may_be_hand:
        return "A person's hand: no, the vehicle had not hovered in the last half second."
    if finding.first.impact.kind is ImpactKind.CONTACT:
        return "A person's hand: yes, the vehicle hovered and the force rose slowly."
    softest = flight.config.fused.soft_m_s2
    if math.hypot(*finding.first.impact.specific_force_frd_m_s2) >= softest:
        return f"A person's hand: no, on a vehicle that hovered, but harder than {softest:.0f} m/s²."
    return "A person's hand: no, on a vehicle that hovered, but force or rates jumped."


# --- what was none ----------------------------------------------------------------------------------------------


def _missed(flight: ShownFlight) -> list[Moment]:
    """Contacts of the simulator's that no impact belongs to."""
    if flight.truth is None:
        return []
    seen = [finding.first.impact.sample_time_boot_us for finding in flight.findings.impacts]
    told, moments = {flight.truth.index_of_hit(boot_us) for boot_us in seen}, []
    for hit in (hit for index, hit in enumerate(flight.truth.hits) if index not in told):
        at_us, boot_us = (clock(hit.contact_at_boot_us) for clock in (flight.truth.at_us, flight.truth.told_us))
        facts = [
            ("Contact began", f"{flight.seconds(at_us):.3f} s"),
            ("Lasted", f"{1e3 * hit.contact_duration_s:.0f} ms"),
            ("Largest force", f"{hit.peak_force_n:.0f} N"),
        ]
        title = f"Not seen: {impact_text(hit.kind, hit.impact_velocity_ned_m_s)}"
        reasons = list(_why_missed(flight, hit, at_us, boot_us))
        place = (hit.contact_position_ned_m, hit.normal_ned, 0.0, boot_us)
        moments.append(Moment("missed", title, at_us, boot_us, facts, reasons, *place))
    return moments


def _why_missed(flight: ShownFlight, hit: "Hit", at_us: float, told_us: float) -> Iterator[str]:
    for word, spans in (("off", flight.findings.off), ("blind", flight.findings.blind)):
        for span in spans:
            if span.start_us <= at_us <= span.end_us:
                yield f"The detector was {word}: {span.reason}."
    until_us = told_us + 1e6 * hit.contact_duration_s + flight.config.estimate.imu_averaging_interval_s * 1e6
    forces, jumps = flight.findings.listener.forces, flight.findings.listener.velocities
    tested, velocities = forces.all(), jumps.all()
    rows = np.flatnonzero((told_us <= tested.time_boot_us) & (tested.time_boot_us <= until_us))
    if not len(rows):
        yield "No IMU sample came while it lasted."
    elif np.any(np.take(tested.phase, rows) == PHASES.index(Phase.CONTACT)):
        yield "It belonged to the contact before, which is one hit."
    else:
        yield from _signs(forces.one(rows[_loudest(np.take(tested.ratio, rows))]))
    rows = np.flatnonzero(np.abs(velocities.time_boot_us - told_us - 0.5 * SHOWN_US) <= 0.5 * SHOWN_US)
    if len(rows):
        yield from _signs(jumps.one(rows[_loudest(np.take(velocities.ratio, rows))]))


def _closest(flight: ShownFlight, others_boot_us: Sequence[float]) -> list[Moment]:
    """What came nearest to being taken for a hit, and was not; none where nothing was watched."""
    nearest = []
    for stream in (flight.findings.listener.forces, flight.findings.listener.velocities):
        ratios = _watched(stream.all(), others_boot_us)
        if np.any(np.isfinite(ratios)):
            nearest.append(stream.one(_loudest(ratios)))
    if not nearest or not len(flight.log.imu_at_us):
        return []
    loudest = max(nearest, key=lambda one: float(one.ratio))
    row = int(np.argmin(np.abs(flight.log.imu_time_boot_us - loudest.time_boot_us)))
    at_us, boot_us = float(flight.log.imu_at_us[row]), float(loudest.time_boot_us)
    title, facts = f"Closest call: {100 * loudest.ratio:.0f} % of a hit", [("At", f"{flight.seconds(at_us):.3f} s")]
    verdict = "Verdict: no hit. Outside of the contacts above nothing in the flight came nearer to one."
    return [Moment("closest", title, at_us, boot_us, facts, [*_signs(loudest), verdict])]


def _watched(tested: Tested, others_boot_us: Sequence[float]) -> Floats:
    """The ratios, NaN where nobody watched and beside other moments."""
    watched = tested.is_armed
    for boot_us in others_boot_us:
        watched &= np.abs(tested.time_boot_us - boot_us) >= _BESIDE_US
    return np.where(watched, tested.ratio, np.nan)


def _loudest(ratios: Floats) -> int:
    """NaN is never the loudest."""
    return int(np.argmax(np.nan_to_num(ratios, nan=-np.inf)))
