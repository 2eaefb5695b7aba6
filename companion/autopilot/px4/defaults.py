"""How PX4 flies unless a person has changed it: limits and patience of the companion follow from these."""

# For so long the last setpoint is flown on: COM_OF_LOSS_T.
LOSS_US = 1_000_000
MAX_SPEED_M_S = 12.0  # MPC_XY_VEL_MAX
MAX_YAW_RATE_DEG_S = 200.0  # MC_YAWRATE_MAX
# With which its own modes turn: MPC_YAWRAUTO_MAX.
TURNING_DEG_S = 45.0
# From a heading error to the rate that ends it: MC_YAW_P.
YAW_GAIN_PER_S = 2.8
LANDING_M_S = 0.7  # MPC_LAND_SPEED
