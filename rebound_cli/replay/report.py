"""A replay in words for a person, and as data for a program."""

import math
import textwrap
from collections.abc import Sequence
from typing import Any

from companion.detection.interface import Evidence, ImpactKind
from companion.messages import LandedState
from rebound_cli.logs.shaking import Stage, clipped
from rebound_cli.replay.findings import Finding, Span
from rebound_cli.replay.reproduction import Reproduction
from rebound_cli.replay.result import Replay, peak_m_s2

SCHEMA = 1

_WIDTH = 110

_HOW = {
    Evidence.FORCE: "the contact's own force",
    Evidence.AFTERMATH: "what followed a contact between the samples",
}


def report_text(replay: Replay, pictures: Sequence[str]) -> str:
    """The whole report; times in seconds since the log's start."""
    log = replay.log
    parts = [_headline(replay)]
    lines = [(happening.at_us, happening.text) for happening in replay.findings.happenings]
    pictured = dict(zip(map(id, replay.findings.impacts), pictures, strict=False))
    for finding in replay.findings.impacts:
        lines.append((finding.at_us, _finding_text(replay, finding, pictured.get(id(finding)))))
    parts.append("\n".join(_timeline_text(log.seconds(at_us), text) for at_us, text in sorted(lines, key=_time)))
    parts.append("\n".join(_wrapped(fact, "", "  ") for fact in _facts(replay)))
    if replay.reproduction is not None:
        parts.append(_wrapped(reproduction_text(replay.reproduction), "", "  "))
    parts.append(verdict_text(replay))
    return "\n\n".join(part for part in parts if part) + "\n"


def _time(line: tuple[int, str]) -> int:
    return line[0]


def _timeline_text(at_s: float, text: str) -> str:
    lead = f"{at_s:9.3f} s  "
    first, *others = text.split("\n")
    hanging = " " * len(lead)
    return "\n".join([_wrapped(first, lead, hanging), *(_wrapped(row, hanging, hanging + "  ") for row in others)])


def _wrapped(text: str, lead: str, hanging: str) -> str:
    return textwrap.fill(text, _WIDTH, initial_indent=lead, subsequent_indent=hanging)


def verdict_text(replay: Replay) -> str:
    """One line: how many collisions, how many touches that are none, and in how much of the flight one would show."""
    collisions, contacts = len(replay.findings.collisions), len(replay.findings.contacts)
    text = f"{collisions or 'no'} collision{'' if collisions == 1 else 's'}"
    text += f", {contacts} contact{'' if contacts == 1 else 's'} that {_are(contacts)} none" if contacts else ""
    share = replay.findings.watched_share
    return text + ("; no flight was heard" if share is None else f"; {100.0 * share:.0f} % of the flight was watched")


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _headline(replay: Replay) -> str:
    log, rate_hz = replay.log, replay.shaking.rate_hz
    rate = f"IMU at {rate_hz:.0f} Hz"
    if abs(rate_hz - replay.recorded_rate_hz) > 1:
        rate += f" (recorded at {replay.recorded_rate_hz:.0f})"
    return f"{log.path}: {log.vehicle}, {log.duration_s:.1f} s, {rate}, detector '{replay.detector}'"


def _finding_text(replay: Replay, finding: Finding, picture: str | None) -> str:
    first, final, impact = finding.first, finding.final, finding.first.impact
    force = math.hypot(*impact.specific_force_frd_m_s2)
    lead = "HIT" if finding.is_collision else "contact, no collision"
    kind = "" if final.kind is ImpactKind.UNKNOWN else f": {final.kind.value}"
    at_least = "at least " if final.is_lower_bound else ""
    rows = [
        f"{lead}{kind}, confidence {final.confidence:.2f}",
        f"seen by {_HOW[impact.evidence]}: {force:.1f} m/s^2, a hit from {finding.threshold_m_s2:.1f} on",
        f"v_c {math.hypot(*first.velocity_ned_m_s):.2f} m/s {_vector(first.velocity_ned_m_s)} NED, "
        f"normal {_vector(final.normal_ned)}",
        f"contact since {replay.log.seconds(_on_log(finding)):.3f} s +-{first.time_error_us / 1e3:.1f} ms",
        f"peak {at_least}{final.peak_specific_force_m_s2:.1f} m/s^2, impulse {at_least}{final.impulse_m_s:.2f} m/s",
        f"{_circumstances(finding)}",
    ]
    if picture is not None:
        rows.append(f"picture: {picture}")
    return "\n".join(rows)


def _on_log(finding: Finding) -> float:
    """t_c on the log's clock: as long before the detection as on the vehicle's."""
    impact = finding.first.impact
    return finding.at_us - (impact.sample_time_boot_us - finding.first.time_boot_us)


def _circumstances(finding: Finding) -> str:
    situation = finding.situation
    height = "height unknown" if situation.height_m is None else f"{situation.height_m:.2f} m up"
    landed = "landed or not unknown"
    if situation.landed_state is not LandedState.UNDEFINED:
        landed = f"vehicle says {situation.landed_state.name.lower().replace('_', ' ')}"
    descent = "descending to land" if situation.descent_commanded else "no descent asked for"
    return f"at the time: {height}, {landed}, {descent}"


def _facts(replay: Replay) -> list[str]:
    noise = replay.shaking.noise_m_s2()
    rows = [
        f"noise floor, {stage.value}: {_numbers(noise[stage].tolist())} m/s^2 RMS (x, y, z)"
        for stage in Stage
        if stage in noise
    ]
    count, how = clipped(replay.log)
    peak = peak_m_s2(replay.log)
    rows.append(f"clipping: {count or 'no'} sample{'' if count == 1 else 's'} ({how}); largest sample {peak:.1f} m/s^2")
    rows.append(_spans_text("blind", replay, replay.findings.blind))
    rows.append(_spans_text("off", replay, replay.findings.off))
    rows.extend(f"note: {loss}" for loss in replay.losses)
    return rows


def _spans_text(word: str, replay: Replay, spans: Sequence[Span]) -> str:
    if not spans:
        return f"{word}: never"
    total_s = sum(span.duration_s for span in spans)
    shown = [
        f"{replay.log.seconds(span.start_us):.2f} s for {span.duration_s:.2f} s ({span.reason})" for span in spans[:4]
    ]
    more = f" and {len(spans) - 4} times more" if len(spans) > 4 else ""
    return f"{word}: {total_s:.2f} s in all: {', '.join(shown)}{more}"


def reproduction_text(reproduction: Reproduction) -> str:
    """Whether the flight was decided again to the bit."""
    extent = (
        f"{reproduction.steps} steps, {reproduction.packets_received} packets in, "
        f"{reproduction.packets_sent} packets out, {reproduction.events} events"
    )
    if reproduction.is_cut:
        extent += "; the program was ended at once, and what came after its last packet is not known"
    if reproduction.first_difference is None:
        return f"identical: every decision of the flight came again to the bit ({extent})"
    return f"NOT identical ({extent}): {reproduction.first_difference}"


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.2f}" for value in values)


def _vector(vector: Sequence[float]) -> str:
    # adding 0.0 turns a rounded -0.0 into 0.0
    return "({})".format(", ".join(f"{round(value, 2) + 0.0:.2f}" for value in vector))


def report_data(replay: Replay, pictures: Sequence[str]) -> dict[str, Any]:
    """The same for a program; vectors NED unless named FRD, SI units, times in seconds since the log's start."""
    log, findings, reproduction = replay.log, replay.findings, replay.reproduction
    count, how = clipped(log)
    names = [*pictures, *[None] * (len(findings.impacts) - len(pictures))]
    return {
        "schema": SCHEMA,
        "log": str(log.path),
        "vehicle": log.vehicle,
        "duration_s": round(log.duration_s, 3),
        "detector": replay.detector,
        "imu_rate_hz": round(replay.shaking.rate_hz, 2),
        "recorded_imu_rate_hz": round(replay.recorded_rate_hz, 2),
        "collisions": len(findings.collisions),
        "impacts": [
            {**_finding_data(replay, finding), "picture": name}
            for finding, name in zip(findings.impacts, names, strict=True)
        ],
        "happenings": [{"at_s": _seconds(replay, h.at_us), "text": h.text} for h in findings.happenings],
        "watched_share": findings.watched_share,
        "blind": [_span_data(replay, span) for span in findings.blind],
        "off": [_span_data(replay, span) for span in findings.off],
        "noise_rms_frd_m_s2": {
            stage.value: [round(float(value), 3) for value in values]
            for stage, values in replay.shaking.noise_m_s2().items()
        },
        "clipped_samples": count,
        "clipping_known_by": how,
        "peak_specific_force_m_s2": round(peak_m_s2(log), 3),
        "notes": list(replay.losses),
        "reproduction": None
        if reproduction is None
        else {
            "identical": reproduction.first_difference is None,
            "first_difference": reproduction.first_difference,
            "steps": reproduction.steps,
            "packets_received": reproduction.packets_received,
            "packets_sent": reproduction.packets_sent,
            "events": reproduction.events,
            "cut": reproduction.is_cut,
        },
    }


def _finding_data(replay: Replay, finding: Finding) -> dict[str, Any]:
    first, final, situation = finding.first, finding.final, finding.situation
    return {
        "at_s": _seconds(replay, finding.at_us),
        "sample_time_boot_us": first.impact.sample_time_boot_us,
        "contact_at_s": _seconds(replay, _on_log(finding)),
        "contact_error_s": first.time_error_us / 1e6,
        "is_collision": finding.is_collision,
        "kind": final.kind.value,
        "evidence": first.impact.evidence.value,
        "confidence": round(final.confidence, 4),
        "specific_force_frd_m_s2": _rounded(first.impact.specific_force_frd_m_s2),
        "threshold_m_s2": round(finding.threshold_m_s2, 4),
        "impact_velocity_m_s": _rounded(first.velocity_ned_m_s),
        "position_m": _rounded(first.position_ned_m),
        "normal": _rounded(final.normal_ned),
        "peak_specific_force_m_s2": round(final.peak_specific_force_m_s2, 4),
        "impulse_m_s": round(final.impulse_m_s, 4),
        "is_lower_bound": final.is_lower_bound,
        "is_final": final.is_final,
        "height_m": None if situation.height_m is None else round(situation.height_m, 4),
        "landed_state": situation.landed_state.name,
        "descent_commanded": situation.descent_commanded,
    }


def _span_data(replay: Replay, span: Span) -> dict[str, Any]:
    return {"at_s": _seconds(replay, span.start_us), "duration_s": round(span.duration_s, 6), "reason": span.reason}


def _seconds(replay: Replay, at_us: float) -> float:
    return round(replay.log.seconds(at_us), 6)


def _rounded(vector: Sequence[float]) -> list[float]:
    return [round(value, 4) for value in vector]
