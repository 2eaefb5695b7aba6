"""The settings of a recovery, and every other number of the planner, with unit and source."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from companion.motion.history import SAME_M_S as SAME_M_S
from companion.motion.strapdown import GRAVITY_M_S2
from companion.strict_model import NotNegative, Positive, StrictModel

# --- the plan
# The thrust's direction lags behind the acceleration setpoint: two time constants of a critically damped attitude loop
# of 12 rad/s, and a motor's 0.02 s.
LEAD_S = 0.15
# A shorter plan ends before a vehicle of that bandwidth has tilted both ways.
SHORTEST_S = 1.25
# Factor on the acceleration limit in front of a surface: a tilt of 31 degrees instead of 17.
HARD_BRAKING = 2.0
# Ratio of one tried duration to the next. The lag is known less precisely than to 5 %.
DURATION_STEP = 1.05
# PX4's velocity loop subtracts a share of the measured acceleration: MPC_XY_VEL_D_ACC, 0.2 at most.
ACCELERATION_GAIN = 1.1
# PX4's MPC_Z_VEL_P_ACC, 1/s: the gain of its own loop against a climb. The companion adds the same again.
CLIMB_GAIN_PER_S = 4.0
# PX4's MPC_Z_P, MPC_XY_P and MPC_XY_VEL_P_ACC, 1/s.
HEIGHT_PER_S, PLACE_PER_S, VELOCITY_PER_S = 1.0, 0.95, 1.8
# A tilt of 14 degrees. Arms that press on a wall carry a vehicle tilted by 15 degrees; from 22 on it tips over.
PRESSING_TILT_M_S2 = 2.5
# Half of gravity, down. The other half is thrust to steer with.
DESCENT_M_S2 = 0.5 * GRAVITY_M_S2
# Acceleration that stops a descent: hover at 78 % of the thrust, not yet level.
STOPPING_M_S2 = 2.0
# Largest heading error asked for after a hit: PX4's MPC_YAWRAUTO_MAX, 45 degrees a second, over its MC_YAW_P, 2.8 1/s.
# A slanted wall turned a real PX4 by 120 degrees. Its motors then spent 0.4 s of thrust on turning back at full rate.
YAW_LEAD_RAD = 0.28

# PX4 holds the last setpoint for COM_OF_LOSS_T, 1 s by default, and notices the silence late: with 1 s set, a real PX4
# changed to hold after 1.04 to 1.13 s (bench/notes/px4.md).
HELD_S, NOTICED_S = 1.0, 0.13
# Largest speed at that moment. From 1 m/s a vehicle stops within 0.2 m with MPC_ACC_HOR.
HELD_TO_M_S = 1.0

# --- half-spaces
# Cosine between two normals. Below it the surfaces face each other, as in a corridor: the goal is then no further from
# one than the middle between them. Walls of a corner are at 0.
FACING_COSINE = -0.5
# Standard deviation of a surface's position and of the hit's: arms fold, and position estimates drift.
PLACE_SPREAD_M = 0.1
# The vehicle's own position is free. A surface that it is behind by two of them is in a wrong place, and is ignored.
BEHIND_M = 2.0 * PLACE_SPREAD_M
# In an acute corner the clearance from one wall leads towards the other. The goal converges in a few rounds or never.
ROUNDS = 5

# --- the present motion
# Time constant of the acceleration's low-pass filter and of corrections by the vehicle's estimate: a few samples of the
# slowest stream, against vibration; shorter than the estimate's noise lasts, longer than its delay. A contact counts so
# long after its last sample: it may go on, or the filtered motion does not contain it yet.
SMOOTHED_S = 0.05
# Cosine of 60 degrees. Beyond this tilt no thrust carries the vehicle.
LEAST_UPRIGHT_COSINE = 0.5
# Hypotheses of how an estimator corrects itself after a clipped hit. A real PX4 has 0.16 s, 4.7 rad/s and a damping of
# 0.67 by motion capture, 0.13 s, 2.4 rad/s and 0.69 by GPS (bench/notes/px4.md). Others are up to twice as fast.
CORRECTION_DELAY_S = np.linspace(0.04, 0.22, 4)
CORRECTION_RAD_S = np.geomspace(2.4, 9.2, 5)
CORRECTION_DAMPING = (0.5, 0.67, 0.85)
# The estimator takes a part of the velocity error for a tilt, which decays slowly: 0.51 and 0.49 per second.
TILT_PER_S = 0.5
# Error of this model on those hits, RMS over 3 s, as a share of the clipped velocity.
MODEL_ERROR = 0.03
# Process noise of the accelerometer's integral: an attitude that is wrong by 2 degrees for 0.3 s.
DRIFT_M2_S3 = 0.03
# The reported velocity is compared with the rate of the reported positions over this time, whose noise of 0.02 m makes
# 0.04 m/s of it. More than twice SAME_M_S is a position that jumped.
COMPARED_S = 0.5
# Standard deviation of the velocity after a hit about the expected one: SAME_M_S, and this share of the speed. Frames
# return 0.2 to 0.9 of it, and the normal is good to 20 degrees.
SPREAD = 0.3


class RecoveryConfig(StrictModel):
    """The mission's `recovery:` part; `gamma` in seconds, one number or one for each horizontal axis."""

    law: Literal["adaptive", "normal", "paper"] = "adaptive"
    """What sets the recovery setpoint."""
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
