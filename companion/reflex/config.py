"""The settings of a recovery, and every other number of the planner, with unit and source."""

from typing import Annotated, Literal

from pydantic import Field

from companion.strict_model import NotNegative, Positive, StrictModel

# --- the plan
# Lag of the thrust's direction behind the acceleration asked for: twice over an attitude loop of 12 rad/s, critically
# damped, and a motor's 0.02 s.
LEAD_S = 0.15
# rad/s. That loop's bandwidth. The spin of a vehicle makes it a gyroscope, whose lean follows later by
# sqrt(1 + (spin / bandwidth)^2).
ATTITUDE_RAD_S = 12.0
# A shorter way is over before a vehicle of that bandwidth has leant both ways.
SHORTEST_S = 1.25
# Braking before a surface asks for all there is; in less than the vehicle takes to lean there is nothing to be gained.
SHORTEST_BRAKING_S = 0.2
# Of the limit: a lean of 31 degrees instead of 17, rather than into a surface.
HARD_BRAKING = 2.0
# Arms give way by so much, and an estimate wavers by it.
TOUCH_TOLERANCE_M = 0.05
# Cosine of 60 degrees: a goal further aside is not run past but turned to, which brakes cannot hasten.
AHEAD_COSINE = 0.5
# Durations are tried in steps of a twentieth, which is less than the lag is known to.
DURATION_STEP = 1.05
# PX4's velocity loop takes back a share of the acceleration that it measures: MPC_XY_VEL_D_ACC, 0.2 at most.
ACCELERATION_GAIN = 1.1
# PX4's MPC_Z_VEL_P_ACC: what its own loop does against a climb, 1/s. As much again is asked for beside it.
CLIMB_GAIN_PER_S = 4.0
# PX4's MPC_Z_P, and level MPC_XY_P and MPC_XY_VEL_P_ACC, 1/s.
HEIGHT_PER_S, PLACE_PER_S, VELOCITY_PER_S = 1.0, 0.95, 1.8
# What PX4's loops leave between a plan and the vehicle that follows it: LEAD_S behind 3 m/s^2, and its integral.
OFF_PLAN_M_S = 0.45
OFF_PLAN_M = 0.3
# A lean of 9 degrees: arms that press on a wall carry a vehicle that leans by 15, from 22 on it is tipped over.
PRESSING_TILT_M_S2 = 1.5
# A lean of 20 degrees into what is touched. Thrust T at a lean a presses with T sin(a), and the motors turn the vehicle
# back with at most a tenth of a metre times T: from 48 degrees on no thrust does; below that a small one does.
HANGING_TILT_M_S2 = 3.6
# Down, half of gravity: leaves thrust to steer with.
DESCENT_M_S2 = 4.9
# What a fall is stopped with, hovering at 78 % of the thrust and not yet level, and what is to be left of the height.
STOPPING_M_S2, LEFT_BELOW_M = 2.0, 0.3
# rad/s. From here on a lean that lags by LEAD_S points half a right angle and more beside what PX4's own loops ask for.
SPINNING_RAD_S = 6.0

# A setpoint that is the last is held for COM_OF_LOSS_T, 1 s by default. PX4 notices the silence late: with 1 s set, a
# real one went into hold after 1.04 to 1.13 s (bench/notes/px4.md).
HELD_S, NOTICED_S = 1.0, 0.13
# A vehicle that does 1 m/s by then is at rest within 0.2 m with MPC_ACC_HOR.
HELD_TO_M_S = 1.0

# --- half-spaces
# Sine of 10 degrees: as well as a normal is known after most hits (bench/notes/detection.md).
NORMAL_SINE = 0.17
# Sine of the normal's angle from the horizontal. Below it height is held, as the vehicle's own lean and a single
# clipped sample tilt the normal of a wall; above it the obstacle is a ceiling, a floor or a steep roof.
STEEP = 0.7
# Cosine between two normals below which surfaces face each other, as in a corridor: away from one is towards the
# other, and where there is not room enough for both distances the middle is kept. Walls of a corner are at 0.
FACING_COSINE = -0.5
# Where the vehicle is, is free: behind a surface by more than an estimate's drift and a touch's depth, the surface is
# not where it was thought to be.
BEHIND_M = 0.2
# In a corner of an acute angle, away from one wall is towards the other: that converges in a few rounds or not at all.
ROUNDS = 5

# --- the present motion
# Mean over the last samples of the slowest stream: vibration is no acceleration of the vehicle's.
SMOOTHED_S = 0.05
# The vehicle's estimate beside the accelerometer's sum: its noise lasts longer, its delay is shorter.
CORRECTED_S = 0.1
# Cosine of 60 degrees: further over no thrust carries the vehicle.
LEAST_UPRIGHT_COSINE = 0.5
# Wind and drag: slower than the steering, faster than the drift they cause.
WIND_S = 1.0
# What pushes on: slower than a lean follows, faster than it tips the vehicle.
EXTERNAL_FORCE_S = 0.2
# A contact pushes still, or what it did is not yet in the estimate, for so long after its last push.
CONTACT_LINGERS_US = 50_000
# Head-on, spring arms push for 0.12 s at 1 m/s, most of it at the beginning, and an estimate is 20 ms late.
MOTION_KNOWN_US = 80_000
# How an estimate is put right after a clipped hit. By motion capture a real PX4 took 0.16 s, 4.7 rad/s and a damping of
# 0.67, by GPS 0.13 s, 2.4 rad/s and 0.69 (bench/notes/px4.md); others are up to twice as late, and twice as fast.
CORRECTION_DELAY_S = (0.04, 0.1, 0.16, 0.22)
CORRECTION_RAD_S = (2.4, 3.4, 4.7, 6.6, 9.2)
CORRECTION_DAMPING = (0.5, 0.67, 0.85)
# A part of what is missing is taken for a tilt, and goes as slowly as that: 0.51 and 0.49 per second.
TILT_PER_S = 0.5
# Of what was hidden, the share by which velocity and, in seconds, place of those hits differ from that, RMS over 3 s.
MODEL_ERROR, MODEL_ERROR_S = 0.03, 0.02
# What the accelerometer's sum drifts by: a tilt that is off by 2 degrees for 0.3 s.
DRIFT_M2_S3 = 0.03
# Of where the hit was.
PLACE_SPREAD_M = 0.1
# Right is what is known to be wrong by no more than four times a good velocity's noise.
CONVERGED_M_S = 0.15
# A velocity that is told is held against the places that are told over this time: their noise of 0.02 m makes 0.04 m/s
# of it. What is more than twice RIGHT_M_S is a place that jumped.
COMPARED_S, MOST_VELOCITY_ERROR_M_S = 0.5, 0.3
# Spreads of the velocity after a hit about the one expected: of the speed into the obstacle (frames give back 0.2 to
# 0.9 of it, and the normal is good to 20 degrees), of the speed by friction, and upwards (0.6 m/s at 5 m/s).
RESTITUTION_SPREAD, FRICTION_SPREAD, VERTICAL_SPREAD, LEAST_SPREAD_M_S = 0.26, 0.1, 0.12, 0.1
# Of what a hit changes, clipping hides anything from none to all.
CLIPPED_PART = 0.5
# What still leans on an obstacle, too softly to be felt, comes nearer by less: arms give way by 5 cm.
NO_CONTACT_APPROACH_M_S = 0.3
# A velocity that changed by less has no direction that 0.08 s of flight and noise could not have made.
LEAST_VELOCITY_CHANGE_M_S = 1.0
# Cosine of 30 degrees: friction leans a push by 17, and the estimate of the normal is good to ten.
AGREEMENT_COSINE = 0.87
# Six times the noise of a good estimate.
LEAVING_M_S = 0.2


class RecoveryConfig(StrictModel):
    """The mission's `recovery:` part; `gamma` in seconds, one number or one for each horizontal axis."""

    law: str = "adaptive"
    """adaptive, normal or paper."""
    gamma: Positive | tuple[Positive, Positive] = 0.5
    """Law `paper`. Law `normal`, and `tangential: kept` of any law, use the first number only. The paper's flights have
    0.5 s."""
    tangential: Literal["damped", "kept"] = "damped"
    """Laws `normal` and `adaptive`: what becomes of the motion along the obstacle."""
    clearance_m: Positive = 0.35
    """Law `adaptive`, but for the vertical acceleration, which `normal` has too. The guards stay 0.3 m clear; the
    wavering of a hover on optical flow takes 5 cm."""
    clearance_s: NotNegative = 0.31
    """More where the hit was harder: half of eq. 3's distance with the paper's gamma, 0.25 s, and what a vehicle still
    trimmed against the drag of its approach stops short by, up to 0.06 s times v_c in simulation."""
    acceleration_m_s2: Annotated[Positive, Field(le=9.81)] = 3.0
    """PX4's MPC_ACC_HOR: a tilt of 17 degrees, which leaves a vehicle that hovers at 78 % of its thrust its height."""
    vertical_acceleration_m_s2: Annotated[NotNegative, Field(le=9.81)] = 3.0
    """Besides the vehicle's own loop, against climbing or falling after a hit. Hovering at 78 % of the thrust leaves
    2.8 m/s^2 upwards. 0: none."""
    restitution: Annotated[NotNegative, Field(le=1.0)] = 0.45
    """Of the speed into the obstacle, until the rebound has been measured: vehicles give back anything up to 0.9."""

    @property
    def gamma_per_axis(self) -> tuple[float, float]:
        return self.gamma if isinstance(self.gamma, tuple) else (self.gamma, self.gamma)
