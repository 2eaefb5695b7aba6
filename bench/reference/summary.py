"""The page of summary.json: the meaning of every key."""

from bench.reference.markdown import code, table

FLIGHT = {
    "schema": "Version of this layout, `1`.",
    "mission": "The mission's name.",
    "outcome": "`completed`: flown as planned and disarmed. `aborted`: began, or was stopped by a person, and ended "
    "early. `failed`: never flew, or an expectation was not met.",
    "reason": "The outcome in words.",
    "autopilot": "What the vehicle said it is.",
    "seed": "Of the simulated vehicle; null on a real one.",
    "airframe": "Of the simulated vehicle; null on a real one.",
    "duration_s": "From the companion's start to its end, in flight time.",
    "wall_clock_s": "The same on the wall's clock, without loading and drawing.",
    "realtime_factor": "`duration_s` over `wall_clock_s`.",
    "tick_lateness_ms": "`p50`, `p99` and `max` of how late due steps began; 0 in lockstep.",
    "step_ms": "`p50`, `p99` and `max` of the time that one step took.",
    "stream_rates_hz": "Measured rate of each message, by its name.",
    "round_trip_ms": "`median` and `worst` of the TIMESYNC round trip; null without an answer. `ignored` counts "
    "answers to nobody's question.",
    "reconnects": "Connections opened again, and returns of the vehicle from another address.",
    "stranger_datagrams": "Dropped datagrams of others than the vehicle.",
    "refused_messages": "Messages with an impossible value, counted by name.",
    "refused_packets": "With `--signing-key`: refused packets, counted by reason.",
    "unconfirmed": "Detections that were not confirmed. They are no `collisions`.",
    "promise": "By this vehicle's noise: the smallest visible hit, as a force and as a velocity jump, and false alarms "
    "an hour; null if never armed.",
    "false_detections": "Detections that no contact explains; null on a real vehicle.",
    "missed_contacts": "Contacts that were not detected; null on a real vehicle.",
    "recontacts": "Contacts before the last collision was recovered from; null on a real vehicle.",
    "expectations": "Of each `expect` its `item`, what was `expected`, whether `met`, what it `was`.",
    "obstacles": "The obstacle map at the end, patch by patch, as in `obstacles.json`.",
    "unreachable": "Items, by their number, and `home`, to which the map left no way.",
    "collisions": "One entry for each collision, in order; see below.",
}
COLLISION = {
    "detected_at_s": "When the message arrived that showed the hit.",
    "detector": "The detector's name.",
    "impact_velocity_ned_m_s": "v_c: velocity just before the contact.",
    "impact_speed_m_s": "Its length.",
    "normal_ned": "Unit direction out of the obstacle.",
    "peak_specific_force_m_s2": "Largest specific force perpendicular to thrust in one IMU sample.",
    "recovery_setpoint_ned_m": "Where the recovery was to end.",
    "settled_after_s": "From the detection to the start of the time at rest; null if the vehicle did not settle.",
    "overshoot_m": "Furthest past the setpoint, away from the obstacle, by telemetry.",
    "rebound_speed_m_s": "Largest speed along the normal in the 0.1 s after the contact, by telemetry; null where the "
    "velocity was not valid.",
    "stopped_off_m": "From the place of the hit to the recovery setpoint, along `normal_ned`.",
    "truth": "What the simulator knows of it; null on a real vehicle and for a false detection.",
}
TRUTH = {
    "kind": "`wall`, `ceiling`, `floor`, `edge` or `pole`.",
    "contact_at_s": "The first touch.",
    "detection_latency_ms": "From the first touch to the arrival of the message that showed it.",
    "impact_velocity_ned_m_s": "Of the centre of mass at the first touch.",
    "normal_ned": "Outward normal of the surface.",
    "contact_duration_s": "From the first touch to the last.",
    "max_fold_m": "Largest fold of any arm.",
    "rebound_speed_m_s": "Along the normal at the last touch.",
    "peak_force_n": "Largest force of the obstacle on the whole vehicle.",
    "factor_of_safety": "185 N over the peak force, by the paper's stress analysis; null for other frames.",
    "impulse_n_s": "Impulse of the whole contact, friction included.",
    "energy_before_j": "Kinetic energy, translation and rotation, at the first touch.",
    "energy_after_j": "The same at the last touch.",
    "overshoot_m": "Furthest past the recovery setpoint along the normal, until the recovery was over. The setpoint is "
    "placed where the vehicle's own frame was at the first touch.",
    "height_lost_m": "Greatest loss of height since the first touch, until the recovery was over.",
    "stopped_off_m": "From the place of the first touch to the recovery setpoint, along the normal.",
}

_TEXT = """# summary.json

One object a flight. `rebound fly MISSION --json` prints the same object on stdout. Times named `_s` count from the
companion's start. Vectors are north, east, down. Positions are in the vehicle's local frame.

## The flight

{flight}
## A collision, by telemetry

{collision}
## The same, by the simulator's truth

{truth}
A recovery is over when the vehicle has been settled for `settled.duration_s`, when the next hit is detected, or 10 s
after the detection.

## Definitions

- A **contact** lasts from the first touch of any part until all parts have been clear for 20 ms. The ground does not
  count.
- A **detection** belongs to a contact that had begun when its sample's averaging window ended, and that had been over
  for no more than 100 ms: velocities show a contact between two samples so late. Each contact explains one detection.
  Any other is a **false detection**.
- A **missed contact** explains no detection.
- A **recontact** is a new contact before the collision before it was recovered from.
"""


def summary_page() -> str:
    parts = {"flight": FLIGHT, "collision": COLLISION, "truth": TRUTH}
    made = {name: table(("key", "meaning"), _rows(keys)) for name, keys in parts.items()}
    return _TEXT.format(**made)


def _rows(keys: dict[str, str]) -> list[tuple[str, str]]:
    return [(code(key), meaning) for key, meaning in keys.items()]
