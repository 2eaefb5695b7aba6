"""Numbers of the estimate of a collision: the mission's `companion.estimate` part."""

from typing import Annotated

from pydantic import Field

from companion.strict_model import NotNegative, Positive, StrictModel


class GuardsConfig(StrictModel):
    """How far the vehicle's guards reach. The defaults are the paper's vehicle's."""

    retired = frozenset({"stiffness_per_s2", "damping_per_s", "travel_m", "gyration_frd_m"})

    centre_m: Positive = 0.145
    """From the vehicle's middle to each guard's, a quad-x."""
    radius_m: Positive = 0.08
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
