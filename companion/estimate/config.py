"""Numbers of the estimate of a collision: the mission's `companion.estimate` part."""

from typing import Annotated

from pydantic import Field

from companion.strict_model import NotNegative, Positive, StrictModel


class GuardsConfig(StrictModel):
    """Where the vehicle's guards are and how a push turns it: from the direction of a push and the turning it makes
    follows where the vehicle was touched. The defaults are the paper's vehicle, arms out and without their springs."""

    centre_m: Positive = 0.145
    """From the vehicle's middle to each guard's, a quad-x."""
    radius_m: Positive = 0.08
    """Of a guard, seen from above."""
    height_m: NotNegative = 0.03
    """Of a guard's rim; 0: a flat disc."""
    stiffness_per_s2: Positive = 250.0
    """Of one arm, per unit mass of the vehicle: half of the paper's k_s, which is two arms'."""
    damping_per_s: NotNegative = 15.0
    """The same of the paper's b_s."""
    travel_m: NotNegative = 0.0
    """How far an arm folds; 0: a frame that does not."""
    gyration_frd_m: tuple[Positive, Positive, Positive] = (0.0553, 0.0553, 0.069)
    """Radii of gyration about body x, y, z: roots of inertia over mass, 0.0034, 0.0034, 0.0053 kg m^2 for 1.112 kg."""


class EstimateConfig(StrictModel):
    """Numbers of the estimate of a collision."""

    retired = frozenset({"jerk_density_m2_s5"})

    inertial: bool = True
    """v_c with the accelerometer's help (see estimate.approach); off: from velocities alone."""

    imu_averaging_interval_s: Annotated[Positive, Field(le=0.1)] = 0.005
    """IMU_INTEG_RATE is 200 Hz by default; SITL's 4 ms is inside this."""
    guards: GuardsConfig = GuardsConfig()
    fits_normal: bool = True
    """The normal by what the touch did to a vehicle whose arms fold: after a hit, some milliseconds of one core with
    each of the next ten messages. Off, or where no arm folds: the direction of the push."""
    velocity_noise_m_s: Positive = 0.04
    """Somewhat above a good flow or motion-capture estimate's 0.03 m/s, as its errors are correlated."""
    velocity_correlation_s: Positive = 0.3
    """How long its errors last: those of optical flow and of a filter behind it change within a third of a second."""
    accelerometer_range_m_s2: Positive = 156.9
    """+-16 g: ICM-20602, IIM-42652. BMI088 reaches 24 g, ICM-45686 32 g."""
    position_noise_m: Positive = 0.03
    """Of a good flow or motion-capture estimate, within the half second that v_c is found from."""

    @property
    def fits_arms(self) -> bool:
        """Whether a touch is fitted for its normal. The fit knows spring arms; of a stiff frame it says no more than
        the direction of the push."""
        return self.fits_normal and self.guards.travel_m > 0.0

    @property
    def reach_m(self) -> float:
        """From the vehicle's middle to the farthest place on a guard's rim."""
        return self.guards.centre_m + self.guards.radius_m
