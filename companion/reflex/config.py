"""Every number of the reflex, with unit and source; the settings last."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from companion.motion.config import GRAVITY_M_S2
from companion.strict_model import NotNegative, Positive, StrictModel

# --- the specific force's noise
# Memory of the mean. It follows drag as the speed changes, and a gust that builds up in a few tenths of a second.
MEAN_MEMORY_S = 0.25
# Memory of standard deviations, good to 5 % with 200 samples, to 12 % at the slowest useful rates; and of the thrust's
# gain, which is known when it is full: it follows a sagging battery (minutes), not a climb, whose thrust is commanded.
MEMORY_S = 2.0
# The noise is known after this time: 50 samples at 50 Hz make a standard deviation good to a tenth.
LEARNT_S = 1.0
# After take-off the rotors' vibration is not learnt yet: the time that a rising standard deviation needs.
SETTLED_US = 300_000
# The standard deviation is taken larger by this factor, for all tests: vibration changes with the throttle, sooner than
# it is learnt. Averaging over 5 ms hides what shakes at 200 Hz, and little of what shakes at 250.
EXCESS = 1.5
# Sideways a vehicle shakes by this share of what it shakes along its thrust at least, as soon as its rotors turn at
# different speeds: while they turn alike they cancel each other. In public logs it is 0.32 to 2 times as much.
LEAST_SIDE_SHARE = 1.0 / 3.0

# --- the accelerometer's place
# Standard deviation of each of its coordinates from the point that the vehicle turns about: in public logs it is 0.02
# to 0.15 m above it, EKF2_IMU_POS_X of PX4's own airframes is 0.02 and 0.06 (bench/notes/decisions.md).
LEVER_M = 0.05
# A turn with less shows too little of it, as an angular acceleration in the mean of RATE_MEMORY_US, or as the square of
# the rates: gyroscopes' noise of up to 0.1 rad/s hides it.
TURNS_PER_S2 = 8.0

# --- a sample's force
# A vehicle vibrates when its threshold is this many times the least one: four public logs have four to nine times. On
# any other the least threshold is that of a force that lasts, as of a gust, and two samples together are no more.
SHAKING = 2.0
# On a vibrating vehicle one sample below this many thresholds may be noise (once in four public logs, with 1.2).
CLEAR = 1.3
# Least jump, in thresholds of at least 1.75 m/s^2. A grip of 30 N s/m stops a kilogram that drifts at 0.1 m/s with
# 2.7 m/s^2, plus noise.
JUMP = 2.4

# --- thrust
# A quadrotor lifts between 1.3 and 5 times its weight. Without ATTITUDE_TARGET a force from below counts only beyond
# the maximum of the strongest vehicle.
STRONGEST_M_S2 = 5.0 * GRAVITY_M_S2
# Error of the gain from the battery, ground effect and a mean that has not converged.
MARGIN = 1.15

# --- velocity jumps
# Number of earlier velocities that the newest is compared with: enough to halve their noise, few enough to be recent.
COMPARED = 3
# Velocities further apart are not compared: samples cover a quarter of the time, and the filter corrects itself in
# between. At 10 Hz healthy vehicles' steps reach 0.3 m/s (four public logs). 30 Hz with a packet lost is inside.
LONGEST_STEP_US = 75_000
# Vibration between the samples is missing in their integral. When a rotor's turns come to beat with the stream, it has
# one sign there for tenths of a second. Its amplitude is 1.4 times the standard deviation of both axes, which is taken
# larger by EXCESS: this is the 0.1 s between the compared velocities.
SHAKEN_S = 0.1

# --- rate jumps
# A jump is one from the mean of the rate over this time: as long as the shortest contact of spring arms.
RATE_MEMORY_US = 20_000
# Of a rate about roll and pitch so much counts, as motors turn a vehicle about them sooner: with up to 96 rad/s^2 in
# public logs.
ACROSS_THRUST = 1.0 / 3.0

# --- the kind of an impact
# Sine of 45 degrees: a force nearer to the vertical is that of a ceiling or a floor.
STEEP = 0.7
# An estimate of the height drifts by this much in a flight by barometer or satellites.
GROUND_M = 1.0
# The feet are 0.1 m below the centre: a vehicle at this height stands on the ground, or scrapes along it.
SCRAPING_M = 0.1

# --- the contact's force
# The sensor clips raw samples before they are averaged: a pulse that fills a third of the window and reaches the range
# is a third of the range in the mean.
CLIPPED_SHARE = 1.0 / 3.0
# A contact of no more samples than this is too short to exclude clipping of its raw peak. Ringing below half of the
# peak, or in another direction, does not count.
SHORT = 2

# --- the normal
# Standard deviations of the directions from the normal, rad, on drawn walls, slanted and leaning walls and poles
# (bench/notes/decisions.md): friction turns a force by 17 degrees, and walls are met at up to 60 degrees.
IMPULSE_RAD, APPROACH_RAD, CHANGE_RAD = 0.35, 0.6, 0.25
# A slower vehicle may have been struck from any side, be pushed by a hand, or slide along a surface. One that is faster
# flies, and drag and wind change with its speed.
SLOW_M_S = 0.5
# Cosine of 120 degrees: directions that are further apart are opposite. No obstacle at rest pushes in the direction of
# flight: what does came from behind, and that direction says nothing of it. Surfaces of opposite normals face each
# other, as in a corridor; walls of a corner are at 0.
OPPOSITE_COSINE = -0.5
# Nothing is known of a direction, rad.
UNKNOWN_RAD = 0.5 * math.pi

# --- validity of the vehicle's velocity
# By then a wrong tilt has decayed from 15 degrees, after 4.2 m/s, to two (0.5 per second, bench/notes/px4.md).
CORRECTED_US = 4_500_000
# What is known of a hit's errors goes with every position until then, and from half of it on less and less: by GPS a
# real PX4's velocity was wrong by 0.4 m/s 10 s after a hit at 3 m/s.
FADED_US = 12_000_000

# --- a sustained force
# Drag and wind are learnt at the setpoint and in free motion: the mean of so long.
FOLLOWED_S = 1.0
# Thrust and velocity alike: leaves 0.15 m/s^2 of what a good velocity's noise makes of an acceleration.
SMOOTHING_S = 0.2
# What an external force takes of the acceleration, besides what drag and wind took before: 12 degrees of tilt. A gust
# of 5 m/s takes 1.5 m/s^2 with a drag of 0.3 per second. Arms that press on a wall carry a vehicle that leans by 15
# degrees; from 22 on it is tipped over. So one that a hit has turned onto a surface presses on it by no more.
HELD_M_S2 = 2.0
# Half of it: what pushes off a surface that was just hit is that surface from then on (bench/notes/decisions.md).
PRESSES_M_S2 = 0.5 * HELD_M_S2
# By then a vehicle has followed its attitude setpoint: twice its attitude's lag. A lean beyond all setpoints since, and
# beyond what lies between them, is by an external torque. Of real PX4s in free flight it is a sine of 0.05 at most
# (bench/notes/decisions.md).
FOLLOWS_US, LEAN_ERROR = 300_000, 0.07
# Other vehicles follow worse: GATE of their own standard deviations count, over a time that is long beside a touch's.
LEAN_ERROR_MEMORY_S = 10.0

# --- confirmation of a hit
# A velocity change of this size from any direction is a hit: twice what an estimate shows of a hit that it missed.
STRUCK_M_S = 0.5
# Standard deviations of the noise that a rejection needs.
SURE = 3.0

# --- the attitude law
# The thrust's direction lags behind the attitude setpoint: two time constants of a critically damped attitude loop of
# 12 rad/s, and a motor's 0.02 s.
LEAD_S = 0.15
# From a speed to the acceleration that brakes it, 1/s: with the attitude's lag, and as much acceleration taken off as
# the vehicle has, the braking has a damping of 0.9 and a time constant of 0.15 s.
BRAKING_PER_S = 7.0
# The way of that to rest over the speed at its beginning: the law's integral from there to rest.
WAY_S = 2.0 / BRAKING_PER_S
# The present tilt is that of so much later: a setpoint's way to the vehicle, and its motors.
TILT_AHEAD_S = 0.05
# Back off a surface, m/s for each metre of the clearance that is missing: a third as fast as the speed is braked.
RETURN_PER_S = BRAKING_PER_S / 3.0
# Height and climb: critically damped, below what thrust and tilt share.
HEIGHT_RAD_S, MOST_CLIMB_M_S2 = 4.0, 4.0
# Largest tilt, 35 degrees: 6.9 m/s^2, with 22 % more thrust than hover's.
MOST_TILT_RAD = 0.61
# Thrust that the tilt leaves for the height, over what hovers at it; and while a turn is braked, for which PX4's mixer
# takes up to 0.15 of all thrust from what lifts (mixYaw).
HOVER_MARGIN, TURN_MARGIN = 1.1, 1.0 / (1.0 - 0.15)
# So PX4's loop of the yaw rate has no more than this to brake; the rest of the turn is asked for.
BRAKED_RAD_S = 1.0
# The rotors keep turning: PX4's MPC_THR_MIN. With less a vehicle does not fly, and the thrust's gain is a quotient of
# small numbers.
LEAST_THRUST = 0.12
# The thrust gain is good enough to fly by after so long: 15 reports of the thrust at 30 Hz.
THRUST_LEARNT_S = 0.5
# Rest, by the belief: as slow as a hovering vehicle wanders by a poor estimate, for so long.
RESTS_M_S, RESTS_S = 0.2, 0.1
# PX4's own modes brake with it by default: MPC_ACC_HOR, MPC_ACC_DOWN_MAX.
BRAKES_M_S2 = 3.0
# An attitude is flown on for COM_OF_LOSS_T: no vehicle that leans by 35 degrees is safe for longer than this.
MOST_HELD_S = 0.3
# No vehicle holds one for longer: PX4's most of COM_OF_LOSS_T.
LONGEST_LOSS_S = 60.0

# --- what a setpoint leads to
# PX4 holds the last setpoint for COM_OF_LOSS_T, 1 s by default, and notices the silence late: with 1 s set, a real PX4
# changed to hold after 1.04 to 1.13 s (bench/notes/px4.md).
HELD_S, NOTICED_S = 1.0, 0.13
# A killed companion's last tilt leads off the obstacle by this, too: what a level that is wrong by 9 degrees leads to.
# Without it a real PX4 touched again after one kill in seven (bench/notes/decisions.md).
AWAY_M_S2 = 1.5

# --- a crash
# PX4's failure detector: FD_FAIL_R and FD_FAIL_P, 60 degrees. It waits for 0.3 s (FD_FAIL_R_TTRI); a vehicle that a hit
# has turned over is upright again within half a second, or never. ArduPilot waits for 2 s (crash_check.cpp).
TIPPED_RAD, TIPPED_US = 1.05, 500_000
# Beyond it no thrust, which acts along body z, carries a vehicle, and one at rest does not fly.
UPRIGHT_COSINE = math.cos(TIPPED_RAD)
# So low and at rest for so long, in a recovery that asks for more: it is on the floor. A vehicle is 0.3 m wide.
LOW_M, LOW_US = 0.3, 1_000_000
# It lies: twice as long.
LIES_US = 2 * LOW_US
# Largest difference of the mean specific force from gravity, and largest rate, of a vehicle that lies while its motors
# shake it; the mean is over about twenty samples.
STILL_M_S2, STILL_RAD_S, LYING_SHARE = 1.0, 0.3, 0.05

# --- half-spaces
# Standard deviation of a surface's position and of the hit's: arms fold, and position estimates drift.
PLACE_SPREAD_M = 0.1
# The vehicle's own position is free. A surface that it is behind by two of them is in a wrong place, and is ignored.
BEHIND_M = 2.0 * PLACE_SPREAD_M
# In an acute corner the clearance from one wall leads towards the other. The goal converges in a few rounds or never.
ROUNDS = 5

# --- the present motion
# Time constant of the acceleration's low-pass filter: a few samples of the slowest stream, against vibration. A contact
# counts until as long after its last sample: it may go on, or the filtered motion does not contain it yet.
SMOOTHED_S = 0.05
# Hypotheses of how an estimator corrects itself after a clipped hit. A real PX4 has 0.16 s, 4.7 rad/s and a damping of
# 0.67 by motion capture, 0.13 s, 2.4 rad/s and 0.69 by GPS (bench/notes/px4.md). Others are up to twice as fast.
CORRECTION_DELAY_S = np.linspace(0.04, 0.22, 4)
CORRECTION_RAD_S = np.geomspace(2.4, 9.2, 5)
CORRECTION_DAMPING = 0.67
# The estimator takes a part of the velocity error for a tilt, which decays slowly: 0.51 and 0.49 per second.
TILT_PER_S = 0.5
# Error of this model on those hits, RMS over 3 s, as a share of the clipped velocity.
MODEL_ERROR = 0.03
# Standard deviation of the velocity after a hit about the expected one: SAME_M_S, and this share of the speed. Frames
# return 0.2 to 0.9 of it, and the normal is good to 20 degrees.
SPREAD = 0.3


class StreamHealthConfig(StrictModel):
    """When a detector counts as blind."""

    silence_s: Positive = 0.25
    """Without IMU or position for so long there is no data. Ten samples of PX4's default 50 Hz, with reserve: whoever
    waits longer for one sees no hit in time."""
    min_rate_hz: Positive = 20.0
    """Least rate of HIGHRES_IMU. 20 Hz is one sample in 50 ms: the longest contacts, about 100 ms, would show in two,
    most in none."""
    max_threshold_m_s2: Positive = 30.0
    """Largest threshold: vibration above it hides hits. By eq. 2 a hit at 1 m/s begins with b_s v_c = 30 m/s^2: a
    vehicle that shakes so much that less cannot be told from its shaking does not see the slower half of its hits."""


class FusedConfig(StrictModel):
    """Settings of the detector `fused`."""

    retired = frozenset(
        {"jolt_rad_s", "jolt_rad_s2", "kick_rad_s", "kick_rad_s2", "kick_push", "spin_rad_s", "spin_rad_s2"}
        | {"velocity_step_turned_m_s", "velocity_step_slow_m_s", "velocity_per_rate_m", "velocity_rest_s", "drag_per_s"}
    )

    side_threshold_m_s2: Positive = 1.75
    """Least lateral external force that is a hit. A good vehicle's 0.25 m/s^2 gives 4.2 times 0.4 (see `floor`: its
    spread reads half too much, to be safe); a gust of 5 m/s adds 1.1 m/s^2 of drag at most. Eq. 2 begins with b_s v_c =
    15 m/s^2 at 0.5 m/s."""
    vertical_threshold_m_s2: Positive = 4.0
    """Least vertical external force that is a hit. Beyond nothing and beyond the propellers' most: those bounds are
    themselves uncertain by a tenth of hover."""
    noise_factor: Positive = 4.2
    """Threshold over the spread learnt in flight, of each test, which reads 1.5 times the true one: 6.3 standard
    deviations, which sideways two of 10^9 normal samples exceed, one in half a thousand hours at 250 Hz."""
    velocity_step_m_s: Positive = 0.12
    """Least velocity jump that is a hit. A good velocity estimate's 0.03 m/s makes steps of 0.02 (RMS) in 40 ms; six
    times that. A foldable vehicle's hit at 0.5 m/s changes its velocity by 0.7 m/s; of a rigid one's, 1 ms long,
    clipping leaves the estimate 0.16."""
    rate_step_rad_s: Positive = 1.2
    """Least jump of the yaw rate that is a hit: 60 rad/s^2 for 20 ms; about roll and pitch three times as much. In
    public logs motors turn a vehicle about its thrust with 17 at most; drawn ones that are flown by hand exceed 30. A
    small one that is tuned to turn faster needs more."""
    rearm_quiet_s: Positive = 0.04
    """A contact is over after this long without force. It lasts 20 to 120 ms, with the force present all through."""
    longest_contact_s: Positive = 0.5
    """Longest contact. Longer loud than this is no contact but a new way to shake, and is learnt."""
    soft_m_s2: Positive = 8.0
    """Below this, on a hovering vehicle, a force may be a hand. A hand is slower than an obstacle: a force that jumps
    is no hand's (see `fused`)."""
    soft_wait_s: Positive = 0.02
    """How long such a force is looked at."""


# No vehicle is larger: more is a length in centimetres or millimetres.
LARGEST_M = 2.0
Length = Annotated[Positive, Field(le=LARGEST_M)]


class GuardsConfig(StrictModel):
    """How far the vehicle's guards reach. The defaults are the paper's vehicle's."""

    retired = frozenset({"stiffness_per_s2", "damping_per_s", "travel_m", "gyration_frd_m"})

    centre_m: Length = 0.145
    """From the vehicle's middle to each guard's, a quad-x."""
    radius_m: Length = 0.08
    """Of a guard, seen from above."""
    height_m: NotNegative = 0.03
    """Of a guard's rim, as the report draws it."""


class EstimateConfig(StrictModel):
    """Numbers of the estimate of a collision."""

    retired = frozenset({"fits_normal", "inertial", "jerk_density_m2_s5"})

    imu_averaging_interval_s: Annotated[Positive, Field(le=0.1)] = 0.005
    """IMU_INTEG_RATE is 200 Hz by default; SITL's 4 ms is inside this."""
    guards: GuardsConfig = GuardsConfig()
    velocity_noise_m_s: Positive = 0.04
    """Somewhat above a good flow or motion-capture estimate's 0.03 m/s, as its errors are correlated."""
    velocity_correlation_s: Positive = 0.3
    """How long its errors last: those of optical flow and of a filter behind it change within a third of a second."""
    accelerometer_range_m_s2: Positive = 156.9
    """+-16 g: ICM-20602, IIM-42652. BMI088 reaches 24 g, ICM-45686 32 g."""
    position_noise_m: Positive = 0.03
    """Of a good flow or motion-capture estimate, over a second."""

    @property
    def reach_m(self) -> float:
        """From the vehicle's middle to the farthest place on a guard's rim."""
        return self.guards.centre_m + self.guards.radius_m


class RecoveryConfig(StrictModel):
    """The mission's `recovery:` part; `gamma` in seconds, one number or one for each horizontal axis."""

    retired = frozenset({"acceleration_m_s2", "clearance_s", "vertical_acceleration_m_s2"})

    law: Literal["adaptive", "normal", "paper"] = "adaptive"
    """What sets the recovery setpoint."""
    gamma: Positive | tuple[Positive, Positive] = 0.5
    """Law `paper`. Law `normal`, and `tangential: kept` of any law, use the first number only. The paper's flights have
    0.5 s."""
    tangential: Literal["damped", "kept"] = "damped"
    """Laws `normal` and `adaptive`: what becomes of the motion along the obstacle."""
    clearance_m: Positive = 0.35
    """Law `adaptive`. The guards stay 0.3 m clear; the drift of a hover on optical flow takes 5 cm."""
    restitution: Annotated[NotNegative, Field(le=1.0)] = 0.45
    """Of the speed into the obstacle, until the rebound has been measured: vehicles give back anything up to 0.9."""

    @property
    def gamma_per_axis(self) -> tuple[float, float]:
        return self.gamma if isinstance(self.gamma, tuple) else (self.gamma, self.gamma)
