"""Settings of the detector `fused`, each with its reason."""

from companion.strict_model import NotNegative, Positive, StrictModel


class FusedConfig(StrictModel):
    """Settings of the detector `fused`."""

    retired = frozenset(
        {"jolt_rad_s", "jolt_rad_s2", "kick_rad_s", "kick_rad_s2", "kick_push", "spin_rad_s", "spin_rad_s2"}
        | {"velocity_step_turned_m_s", "velocity_per_rate_m", "velocity_rest_s"}
    )

    side_threshold_m_s2: Positive = 1.75
    """Least lateral external force that is a hit. A good vehicle's 0.25 m/s^2 gives 4.2 times 0.4 (see `floor`: its
    spread reads half too much, to be safe); a gust of 5 m/s adds 1.1 m/s^2 of drag at most. Eq. 2 begins with b_s v_c =
    15 m/s^2 at 0.5 m/s."""
    vertical_threshold_m_s2: Positive = 4.0
    """Least vertical external force that is a hit. Beyond nothing and beyond the propellers' most: those bounds are
    themselves uncertain by a tenth of hover."""
    noise_factor: Positive = 4.2
    """Threshold over the spread of the specific force learnt in flight, which reads at least 1.5 times the true
    one: 6.3 standard deviations, which sideways two of 10^9 normal samples exceed, one in half a
    thousand hours at 250 Hz."""
    drag_per_s: NotNegative = 0.3
    """Room for drag: per mass it is 0.2 to 0.4 /s times the speed, and turns with the vehicle."""
    velocity_step_m_s: Positive = 0.12
    """Least velocity jump that is a hit. A good velocity estimate's 0.03 m/s makes steps of 0.02 (RMS) in 40 ms; six
    times that. A foldable vehicle's hit at 0.5 m/s changes its velocity by 0.7 m/s; of a rigid one's, 1 ms long,
    clipping leaves the estimate 0.16."""
    velocity_step_slow_m_s: Positive = 0.7
    """The same of velocities at 8 to 13 Hz: more than twice what healthy vehicles' steps reach at 10 Hz."""
    rate_step_rad_s: Positive = 2.0
    """Least rate jump that counts beside a velocity jump, more than motors make in the same time. A push at 0.15 m from
    the centre that turns the vehicle by 2 rad/s changes its velocity by 0.06 m/s, half of `velocity_step_m_s`."""
    rearm_quiet_s: Positive = 0.04
    """A contact is over after this long without force. It lasts 20 to 120 ms, with the force present all through."""
    longest_contact_s: Positive = 0.5
    """Longest contact. Longer loud than this is no contact but a new way to shake, and is learnt."""
    soft_m_s2: Positive = 8.0
    """Below this, on a hovering vehicle, a force may be a hand. A hand is slower than an obstacle: below `soft_m_s2` on
    a hovering vehicle wait for the force to show itself, for so long at most; a force that jumps is no hand's (see
    `force_signs`)."""
    soft_wait_s: Positive = 0.02
    """How long such a force is looked at."""
