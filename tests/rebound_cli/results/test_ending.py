"""What a person reads at the end of a flight."""

import copy

from rebound_cli.results.ending import ending_text

HIT = {
    "impact_speed_m_s": 1.98,
    "settled_after_s": 1.728,
    "stopped_off_m": 0.53,
    "truth": {
        "kind": "wall",
        "impact_velocity_ned_m_s": [1.96, 0.0, 0.05],
        "detection_latency_ms": 2.61,
        "height_lost_m": 0.021,
        "peak_force_n": 342.4,
        "stopped_off_m": 0.59,
    },
}
FLIGHT = {
    "mission": "wall",
    "outcome": "completed",
    "reason": "landed and disarmed, 1 hit",
    "airframe": "foldable",
    "seed": 1,
    "duration_s": 27.0,
    "wall_clock_s": 1.7,
    "false_detections": 0,
    "missed_contacts": 0,
    "recontacts": 0,
    "unconfirmed": 0,
    "obstacles": [],
    "unreachable": [],
    "collisions": [HIT],
}


def told(*changed_hits, **changes):
    """The lines after the headline."""
    flight = {**FLIGHT, **changes}
    if changed_hits:
        flight["collisions"] = list(changed_hits)
    return ending_text(flight).splitlines()[2:]


def hit(truth=True, **changes):
    """The hit with other figures, or as a real vehicle has it, without the simulator's."""
    other = copy.deepcopy(HIT)
    if truth is not True:
        other["truth"] = None
    other.update({key: value for key, value in changes.items() if key in other})
    if other["truth"] is not None:
        other["truth"].update({key: value for key, value in changes.items() if key in other["truth"]})
    return other


def test_a_real_vehicle_is_told_of_by_its_telemetry_alone():
    real = dict.fromkeys(("false_detections", "missed_contacts", "recontacts", "airframe", "seed"))
    assert told(hit(truth=None), **real) == ["Hit something at 1.98 m/s. Stopped 0.5 m off it in 1.7 s, landed safely."]


def test_what_went_wrong_is_told_and_no_landing_is_claimed():
    # Given a flight that was aborted in its second recovery, with a false alarm and a contact that nobody saw
    lines = told(
        hit(truth=None),
        hit(settled_after_s=None),
        outcome="aborted",
        false_detections=1,
        missed_contacts=2,
        recontacts=1,
    )
    # Then each is a sentence
    assert lines[0] == "1. False alarm: nothing was touched."
    assert "Not yet still when the flight went on" in lines[1]
    assert "2 hits not seen." in lines
    assert "1 hit before the vehicle had recovered from the one before." in lines
    assert not any("afely" in line for line in lines)
