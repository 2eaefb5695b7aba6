"""Numbers of streams, of the integrated accelerometer and of rest, with unit and source."""

import math

from companion.strict_model import NotNegative, Positive, StrictModel

# --- time
# Evidence for or against a hit lies within 0.3 s of it; the origin is the mean of a second. A time further back than
# this is not that of a reordered packet but of a rebooted vehicle. By then each stream has sent a message: those that a
# detector uses come ten times a second and more.
KEPT_US = 2_000_000
# PX4 cuts time_boot_ms to whole milliseconds: a stamp may be this much before its sample.
STAMP_RESOLUTION_US = 1_000
# A message counts as current for this time: 15 of PX4's ODOMETRY at 30 Hz, whose velocities and reset counter are used
# until then, as are those of ATTITUDE_TARGET.
CURRENT_US = 500_000
# The vehicle's estimate shows a hit by this time: all but the longest contacts are over (0.12 s at 1 m/s), it is 20 to
# 40 ms late, and a filter's switching makes it swing. Then it is decided: a tilt of 17 degrees for this time moves a
# vehicle by 3 cm. Velocities before the hit are averaged over the same time: the shorter, the smaller are slow errors.
# Not before it, but for 10 ms, does PX4's begin to correct what was hidden (bench/notes/px4.md).
SHOWN_US = 150_000
# A velocity that differs by less does not differ: four times the noise of a good estimate, which reaches 0.1 m/s now
# and then. An estimate has converged when its known error stays below that.
SAME_M_S = 0.15

# --- the integrated accelerometer
GRAVITY_M_S2 = 9.80665
# A longer gap restarts the integral: two samples of 20 Hz, the least rate of HIGHRES_IMU. An attitude further from a
# sample is not carried on to it.
LONGEST_GAP_US = 100_000
# Largest lag of a velocity that is compared with the integral (optical flow with an output predictor: 20 ms).
LONGEST_DELAY_US = 40_000
# Tilt error of a PX4 estimate after a clipped hit, for each m/s of its speed: of what is hidden, twice that at most, a
# real PX4 takes 0.037 rad for each m/s with motion capture and 0.056 with GPS (bench/notes/px4.md). The same again for
# a speed of 1 m/s: the obstacle may move. Where attitude and gyroscopes differ by more, the gyroscopes are wrong.
TILT_RAD_PER_M_S = 0.11
# Largest angular acceleration by motors, rad/s^2.
MOTORS_RAD_S2 = 100.0

# HIGHRES_IMU has the time of a sample, SCALED_IMU the millisecond in which PX4 went on with it.
SAME_SAMPLE_US = 2 * STAMP_RESOLUTION_US
# Two samples of SCALED_IMU are rounded by thousandths of g, on three axes: three times that.
ROUNDED_M_S2 = 3.0 * math.sqrt(3.0) * 1e-3 * GRAVITY_M_S2
# Largest change of an estimator's biases: PX4's EKF2_ABL_LIM and EKF2_GYR_B_LIM, from one end to the other.
MOST_BIAS_M_S2, MOST_BIAS_RAD_S = 0.8, 0.3

# What is further off, in standard deviations, is beyond belief: PX4's gates, such as EKF2_GPS_V_GATE.
GATE = 5.0
# Memory of a velocity's noise in velocities: 3 s of the vehicle's own at 30 Hz, 10 to 20 s of a receiver's.
MEMORY_STEPS = 100

# --- the velocity's delay
# Prior, and its own standard deviation: PX4's output predictor leaves no delay, optical flow behind it up to 20 ms.
DELAY_S = 0.01
# Longest delay that is estimated: compared velocities lie 0.1 s apart (four at PX4's 30 Hz of ODOMETRY).
LATEST_S = 0.1

# Process noise of the accelerometer's integral: an attitude that is wrong by 0.8 degrees for 1 s. After hits of a real
# PX4 it is 0.05 to 0.16 m/s off by then.
DRIFT_M2_S3 = 0.02
# Standard deviation of the acceleration that a tilt makes which is wrong by the gyroscopes, too: 3 degrees.
LEVEL_SPREAD_M_S2 = 0.5
# How fast that acceleration spreads, (m/s^2)^2 in a second: after a clipped hit PX4 takes 0.01 rad/s of a turn for the
# gyroscopes' bias, and takes it off HIGHRES_IMU.
LEVEL_DRIFT_M2_S5 = (0.01 * GRAVITY_M_S2) ** 2

# --- a receiver's place and velocity
# The earth's mean radius.
EARTH_M = 6_371_000.0
# Delay of a satellite receiver's velocity: PX4's default EKF2_GPS_DELAY; the receivers that ArduPilot knows have 0.1 to
# 0.22 s (AP_GPS's get_lag), a simulated one none. Then its standard deviation, and the longest.
RECEIVER_DELAY_S, RECEIVER_SPREAD_S, RECEIVER_LATEST_S = 0.11, 0.06, 0.3
# Receivers filter what they measure: ten of them, or a second, have the same error.
RECEIVER_REPEATS = 10.0
# Standard deviation of its noise before it is learnt: PX4's EKF2_GPS_V_NOISE. Not below twice the 0.05 m/s of u-blox's
# data sheets.
DOPPLER_M_S, FINEST_DOPPLER_M_S = 0.3, 0.1
# Standard deviation of its place before that is learnt: PX4's EKF2_GPS_P_NOISE.
RECEIVER_PLACE_M = 0.5
# Standard deviations of the delay by which a velocity is taken for older, so that none from before a hit counts.
CERTAIN = 2.0


class SettledConfig(StrictModel):
    """When a recovery has ended."""

    distance_m: Positive = 0.10
    """Largest distance to the recovery setpoint."""
    speed_m_s: Positive = 0.10
    """Largest speed."""
    duration_s: Positive = 0.5
    """How long both must hold."""
    timeout_s: Positive = 10.0
    """A healthy recovery takes 2 to 4 s; after three times that the mission goes on without it."""
    smoothing_s: NotNegative = 0.1
    """Mean over about five samples at 50 Hz: brings a 0.03 m/s RMS velocity noise per axis to 0.01 m/s, so that
    the speed of a vehicle at rest stays clear of `speed_m_s` for the whole of `duration_s`."""
