"""One replay, whichever kind of log it is: from the log to findings, in words for a person."""

import math
import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from companion.messages import Vector3
from companion.mission.config import CompanionConfig
from companion.reflex.detection.detector import Evidence, ImpactKind
from companion.reflex.detection.impact import ImpactEstimate
from companion.reflex.surface import Normal
from rebound_cli.logs.log import WANTED, Log, clipping_text
from rebound_cli.replay.recording import Recording, reproduce
from rebound_cli.replay.watching import Finding, Findings, watch_log

_WIDTH = 110
# What each sign is called, in which unit and to how many digits.
SIGNS = {
    "side": ("Push sideways", "m/s²", 1),
    "beyond": ("Push along the thrust", "m/s² beyond the propellers", 1),
    "turn": ("Turn at once", "rad/s", 1),
    "jump": ("Velocity jump", "m/s that no sample shows", 2),
}


@dataclass(frozen=True, slots=True)
class Replay:
    """What was looked at, with what, and what was found; of our own flight that was decided again, the `recording` and
    the first `difference` from it.
    """

    log: Log
    config: CompanionConfig
    findings: Findings
    recording: Recording | None = None
    difference: str | None = None


def replay_log(log: Log, config: CompanionConfig, modes: Sequence[str] | None = None) -> Replay:
    """What a guard's detector makes of the log.

    `modes`: those in which the guard may take over; None: it watches whoever flies.
    """
    return Replay(log, config, watch_log(log, config, modes))


def replay_flight(log: Log, recording: Recording) -> Replay:
    """Our own flight decided again, from the first byte to the last."""
    findings, difference = reproduce(recording)
    # The flight's own zero, so that times are those of its timeline.
    log = replace(log, started_at_us=recording.steps[0].time_us)
    return Replay(log, recording.settings.companion, findings, recording, difference)


def report_text(replay: Replay) -> str:
    """The whole report; times in seconds since the log's start."""
    log = replay.log
    headline = f"{log.path}: {log.vehicle}, {log.duration_s:.1f} s, IMU at {log.imu_rate_hz:.0f} Hz"
    told: list[tuple[int, list[str]]] = [(at_us, [text]) for at_us, text in replay.findings.happenings]
    if replay.recording is None:
        # Each interval in which a guard would have left a hit to whoever flies.
        spans = replay.findings.off
        told += [(s.start_us, [f"not watched for {s.duration_s:.2f} s: {s.reason}"]) for s in spans]
    told += [(finding.at_us, list(_finding_rows(replay, finding))) for finding in replay.findings.impacts]
    timeline = [_entry(log.seconds(at_us), texts) for at_us, texts in sorted(told, key=lambda row: row[0])]
    parts = [f"{headline}, detector '{replay.config.detector}'", *(["\n".join(timeline)] if timeline else [])]
    parts.append("\n".join(_wrapped(fact, "", "  ") for fact in _facts(replay)))
    if replay.recording is not None:
        parts.append(_wrapped(_reproduction_text(replay.recording, replay.difference), "", "  "))
    return "\n\n".join([*parts, _verdict(replay)]) + "\n"


def _entry(at_s: float, texts: Sequence[str]) -> str:
    lead = f"{at_s:9.3f} s  "
    hanging = " " * len(lead)
    first, *others = texts
    return "\n".join([_wrapped(first, lead, hanging), *(_wrapped(row, hanging, hanging + "  ") for row in others)])


def _wrapped(text: str, lead: str, hanging: str) -> str:
    return textwrap.fill(text, _WIDTH, initial_indent=lead, subsequent_indent=hanging)


def _verdict(replay: Replay) -> str:
    """One line: how many collisions and crashes, how many touches that are none, and how much was watched."""
    collisions, contacts = len(replay.findings.collisions), replay.findings.contacts
    touchdowns = sum(contact.first.impact.is_ground for contact in contacts)
    others = len(contacts) - touchdowns
    crashes = len(replay.findings.crashes)
    text = f"{collisions or 'no'} collision{'' if collisions == 1 else 's'}"
    text += f", {crashes} of them {'a crash' if crashes == 1 else 'crashes'}" if crashes else ""
    text += f", {touchdowns} touchdown{'' if touchdowns == 1 else 's'}" if touchdowns else ""
    text += f", {others} contact{' that is' if others == 1 else 's that are'} none" if others else ""
    share = replay.findings.watched_share
    if share is None:
        return f"{text}; no flight was heard: that is no evidence"
    watched = f"{100.0 * share:.0f} % of the flight was watched"
    return f"{text}; {watched}" if share else f"{text}; nothing of the flight was watched: that is no evidence"


def _finding_rows(replay: Replay, finding: Finding) -> Iterator[str]:
    what = "CRASH" if finding.is_crash else "HIT" if finding.is_collision else "contact, no collision"
    yield f"{what}: {kind_text(finding)}, seen by {_seen_by(replay, finding)}"
    yield from (
        f"{name.lower()}: {text}" for name, text in impact_facts(finding, finding.final.normal, replay.log.seconds)
    )


def _seen_by(replay: Replay, finding: Finding) -> str:
    """The innovation that was largest beside its limit, as the detector published it; where it did not, the force."""
    impact = finding.first.impact
    if impact.evidence is Evidence.SUSTAINED:
        return lasting_text(finding.first)
    tested, _ = replay.findings.listener.shown.get(impact.sample_time_boot_us, (None, False))
    if tested is None or math.isnan(tested.ratio):
        return f"{impact.size_m_s2:.1f} m/s², a hit from {finding.threshold_m_s2:.1f} on"
    sign = max(tested.signs, key=tested.ratio_of)
    name, unit, digits = SIGNS[sign]
    value, limit = tested.signs[sign]
    return f"{name.lower()}: {value:.{digits}f} {unit}, a hit from {limit:.{digits}f} on"


def lasting_text(estimate: ImpactEstimate) -> str:
    """Of what no detector has shown."""
    return f"a force that lasts: {estimate.impact.size_m_s2:.1f} m/s² for {estimate.time_error_us * 1e-6:.1f} s"


def impact_facts(finding: Finding, normal: Normal, seconds: Callable[[float], float]) -> list[tuple[str, str]]:
    """What was measured of it; `seconds`: since the flight began, of a time on the log's clock."""
    first, final = finding.first, finding.final
    # As long before the detection as on the vehicle's clock.
    contact_at_us = finding.at_us - (first.impact.sample_time_boot_us - final.time_boot_us)
    least = "at least " if final.is_lower_bound else ""
    return [
        ("Detected", f"{seconds(finding.at_us):.3f} s"),
        ("Contact began", f"{seconds(contact_at_us):.4f} s ± {final.time_error_us / 1e3:.1f} ms"),
        ("Speed before it", speed_text(finding)),
        ("Largest force in a sample", f"{least}{final.peak_specific_force_m_s2:.1f} m/s²"),
        ("Impulse", f"{least}{final.impulse_m_s:.2f} m/s"),
        ("Normal", f"{bearing(normal.direction_ned)} ± {math.degrees(normal.error_rad):.0f}°"),
        ("Taken for", kind_text(finding)),
    ]


def kind_text(finding: Finding) -> str:
    kind = finding.final.impact.kind
    return kind.value if kind is not ImpactKind.UNKNOWN else "something"


def speed_text(finding: Finding) -> str:
    first = finding.first
    return f"{math.hypot(*first.velocity_ned_m_s):.2f} ± {first.velocity_error_m_s:.2f} m/s"


def bearing(normal_ned: Vector3) -> str:
    """Where a surface faces."""
    north, east, down = normal_ned
    if abs(down) > math.hypot(north, east):
        return "faces down" if down > 0.0 else "faces up"
    return f"faces {math.degrees(math.atan2(east, north)) % 360.0:.0f}°"


def _facts(replay: Replay) -> Iterator[str]:
    peak_m_s2 = max(math.hypot(*sample.specific_force_frd_m_s2) for _, sample in replay.log.imu())
    yield f"{clipping_text(replay.log)}; largest sample {peak_m_s2:.1f} m/s^2"
    for word, spans in (("blind", replay.findings.blind), ("off", replay.findings.off)):
        total_s = sum(span.duration_s for span in spans)
        shown = [f"{replay.log.seconds(s.start_us):.2f} s for {s.duration_s:.2f} s ({s.reason})" for s in spans[:4]]
        more = f" and {len(spans) - 4} more" if len(spans) > 4 else ""
        yield f"{word}: {total_s:.2f} s in all: {', '.join(shown)}{more}" if spans else f"{word}: never"
    yield from (f"note: {loss}" for loss in replay.log.losses)
    config, kinds = replay.config, {type(heard.sample) for heard in replay.log.heard}
    detector = config.detectors[config.detector](getattr(config, config.detector), 0)
    for message, loss in detector.losses.items():
        if message in WANTED and WANTED[message] not in kinds:
            yield f"note: without {message.name} '{config.detector}' loses: {loss}"
    if replay.recording is None and replay.findings.is_flying:
        yield "note: the log ends in flight, cut short or without power: what came then is not in it"


def _reproduction_text(recording: Recording, difference: str | None) -> str:
    """Whether the flight was decided again to the bit."""
    received, sent = (sum(len(getattr(step, way)) for step in recording.steps) for way in ("received", "sent"))
    extent = f"{len(recording.steps)} steps, {received} packets in, {sent} packets out"
    extent += f", {len(recording.event_lines)} events"
    if recording.is_cut:
        extent += "; the program was ended at once, and what came after its last packet is not known"
    if difference is None:
        return f"identical: every decision of the flight came again to the bit ({extent})"
    return f"NOT identical ({extent}): {difference}"
