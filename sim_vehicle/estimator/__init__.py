"""The vehicle's own estimator as the paper flew it: inertial sensor, optical flow and range in a Kalman filter."""
