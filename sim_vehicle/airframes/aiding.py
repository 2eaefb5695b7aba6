"""The `sensors:` and `estimator:` parts of an airframe file: what aids the vehicle's own Kalman filter."""

from sim_vehicle.written import NotNegative, Part, Positive


class Aid(Part):
    """What every aiding sensor has."""

    fitted: bool
    """Whether the vehicle has it."""
    rate_hz: Positive
    """Samples a second."""
    delay_s: NotNegative
    """How late a sample reaches the filter, which fuses it at the time it was taken."""


class OpticalFlow(Aid):
    """A camera that looks down and says by what angle the ground has moved (OPTICAL_FLOW_RAD)."""

    noise_rad_s: Positive
    """Standard deviation of one sample's mean angular rate."""
    gyroscope_noise_rad_s: NotNegative
    """The same for the camera's own gyroscope."""
    rate_max_rad_s: Positive
    """Faster flow than this is not seen."""
    distance_min_m: NotNegative
    """Nearer ground is not seen."""
    distance_max_m: Positive
    """Farther ground is not seen."""


class RangeFinder(Aid):
    """A beam that looks down (DISTANCE_SENSOR)."""

    noise_m: Positive
    """Standard deviation of one sample."""
    bias_m: NotNegative
    """Standard deviation of the constant error that is drawn for each flight."""
    distance_min_m: NotNegative
    """Nearer ground is not seen."""
    distance_max_m: Positive
    """Farther ground is not seen."""


class Compass(Aid):
    """Magnetometer, as a heading."""

    noise_rad: Positive
    """Standard deviation of one heading."""


class MotionCapture(Aid):
    """Cameras around the room: position and heading."""

    noise_m: Positive
    """Standard deviation of one position, per axis."""
    noise_rad: Positive
    """Standard deviation of one heading."""


class Sensors(Part):
    """What is fitted beside the inertial sensor."""

    optical_flow: OpticalFlow
    range_finder: RangeFinder
    compass: Compass
    motion_capture: MotionCapture

    @property
    def can_navigate(self) -> bool:
        """Whether velocity, height and heading are all observed."""
        flow_range_heading = self.optical_flow.fitted and self.range_finder.fitted and self.compass.fitted
        return flow_range_heading or self.motion_capture.fitted

    @property
    def delay_s(self) -> float:
        """The latest of the fitted sensors' samples."""
        aids: tuple[Aid, ...] = (self.optical_flow, self.range_finder, self.compass, self.motion_capture)
        return max((aid.delay_s for aid in aids if aid.fitted), default=0.0)


class Estimator(Part):
    """Tuning of the filter that the sensors' own figures do not give."""

    gyroscope_bias_walk_rad_s2: NotNegative
    """Standard deviation by which a gyroscope's bias may wander, per square root of a second."""
    accelerometer_bias_walk_m_s3: NotNegative
    """The same of an accelerometer."""
    clipped_excess_m_s2: NotNegative
    """What a clipped raw sample may have lost: standard deviation of the force beyond the sensor's range."""
    flow_gate: Positive
    """Innovations of more standard deviations than this are not fused."""
    range_gate: Positive
    """As `flow_gate`, of the range finder."""
    heading_gate: Positive
    """As `flow_gate`, of the heading."""
    capture_gate: Positive
    """As `flow_gate`, of motion capture."""
    reset_after_s: Positive
    """Without anything fused for this long, the next good sample resets what it measures."""
