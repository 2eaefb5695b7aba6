"""The mission's `companion:` part: every key optional, every default with its reason."""

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field, field_validator, model_validator

from companion.detection.fused_config import FusedConfig
from companion.detection.registry import BASELINES, DETECTORS, MakeDetector, check_known_detector
from companion.detection.sight import SightConfig
from companion.written import NotNegative, Positive, Written

Rate = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0, le=1000.0)]


class StreamsConfig(Written):
    """Rates asked for, and the least measured rates with which a flight begins, in Hz."""

    highres_imu_hz: Rate = 250.0
    """PX4 rounds the interval to whole IMU samples: 200 gives 124, 250 gives all of them (measured on SITL)."""
    local_position_hz: Rate = 50.0
    """Twenty-five velocities in the half second before a contact are enough for v_c (see estimate.collision)."""
    attitude_hz: Rate = 50.0
    """Which way the thrust points, and how the vehicle turns."""
    extended_sys_state_hz: Rate = 5.0
    """Take-off and touchdown last longer than a second."""
    attitude_target_hz: Rate = 30.0
    """The thrust asked for changes by less than a third of the greatest within 33 ms (see detection.thrust). Asked for
    only by a detector that uses it."""
    odometry_hz: Rate = 30.0
    """PX4's own rate on an onboard link; only its reset counter and microsecond stamps are made use of."""
    vibration_hz: Rate = 1.0
    """Cumulative counts; twice a second is PX4's own rate."""
    current_mode_hz: Rate = 10.0
    """Mode changes are acted on within a tenth of a second."""
    window_s: Positive = 2.0
    """Long enough to see 80 samples of the slowest acceptable IMU stream."""
    min_highres_imu_hz: NotNegative = 40.0
    """PX4's onboard default is 50 Hz; below 40 Hz more than 80 % of a 25 ms contact can fall between samples."""
    min_local_position_hz: Positive = 10.0
    """A tenth of a second between positions is 0.2 m at 2 m/s, the most a setpoint may be wrong by."""
    min_attitude_hz: Positive = 10.0
    """A tenth of a second of turning at 1 rad/s is 6 degrees."""


class GuardsConfig(Written):
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


class EstimateConfig(Written):
    """Numbers of the estimate of a collision."""

    inertial: bool = True
    """v_c with the accelerometer's help (see estimate.approach); off: from positions and velocities alone."""

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
    jerk_density_m2_s5: Positive = 4.0
    """White-jerk density: a go_to's 2 m/s^2 may come or go within any second, (2 m/s^2)^2 / 1 s. It leaves
    0.02 m/s of noise in cruise and follows an acceleration that ended 0.1 s before the hit to 0.04 m/s."""

    @property
    def fits_arms(self) -> bool:
        """Whether a touch is fitted for its normal. The fit knows spring arms; of a stiff frame it says no more than
        the direction of the push."""
        return self.fits_normal and self.guards.travel_m > 0.0

    @property
    def reach_m(self) -> float:
        """From the vehicle's middle to the farthest place on a guard's rim."""
        return self.guards.centre_m + self.guards.radius_m


class SettledConfig(Written):
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


class LinkConfig(Written):
    """Patience with the other end."""

    heartbeat_wait_s: Positive = 10.0
    """PX4 announces itself once a second; ten misses are not bad luck."""
    silence_s: Annotated[Positive, Field(ge=0.2)] = 1.5
    """More than the one-second HEARTBEAT interval, so that a lost packet is not a lost link, and still sooner
    than anyone notices a vehicle flying on its own."""
    position_silence_s: Annotated[Positive, Field(ge=0.1)] = 1.0
    """A position this old is 2 m wrong at 2 m/s: nothing flown on it is safe."""


class FlightConfig(Written):
    """How the flight itself is flown."""

    setpoint_hz: Annotated[Rate, Field(ge=20.0)] = 50.0
    """Well above the 2 Hz that holds OFFBOARD; 50 Hz so that a moving setpoint advances 4 cm a step at 2 m/s."""
    setpoint_lead_s: Annotated[Positive, Field(ge=1.0)] = 1.0
    """PX4 wants to see the stream before the switch; its documentation asks for more than a second of it."""
    takeoff_speed_m_s: Annotated[Positive, Field(le=3.0)] = 1.0
    """Below PX4's MPC_Z_VEL_MAX_UP of 3 m/s and near its MPC_TKO_SPEED of 1.5 m/s."""
    takeoff_acceleration_m_s2: Annotated[Positive, Field(le=5.0)] = 1.0
    """Of the beginning and the end of the climb."""
    cruise_speed_m_s: Annotated[Positive, Field(le=12.0)] = 1.0
    """Of items that state no speed: a quick walk, at which a hit does no harm to an airframe with guards."""
    cruise_acceleration_m_s2: Annotated[Positive, Field(le=9.81)] = 2.0
    """A tilt of 11 degrees, well inside every multicopter's."""
    speeding_up_m_s2: Annotated[Positive, Field(le=9.81)] = 1.0
    """The most, of any item's acceleration, with which the horizontal speed grows. A vehicle that leans into its way is
    hit below its centre and tips: beyond 10 degrees at 3 m/s, or 16 at 1 m/s, its thrust then pins it to the obstacle
    (docs/explanation/recovery.md). This leans it by 6, and what a head wind leans it by is taken off it; drag comes on
    top. Braking leans it the other way."""
    acceptance_radius_m: Positive = 0.5
    """A waypoint is passed, not settled on. A PX4 that flies by GPS wanders by this much around a setpoint (its own
    simulator's noise moves a hover by 0.5 m); a quarter of it could be missed for a long time."""
    arrival_timeout_s: Positive = 15.0
    """Time allowed to arrive after the profile has ended: a wind or a drag it did not know of."""


class OperatorConfig(Written):
    """What a ground station is told; nothing of it is needed to fly."""

    status_texts: bool = True
    """Hits, recoveries, limits and the outcome, as STATUSTEXT."""
    values_hz: Annotated[NotNegative, Field(le=50.0)] = 2.0
    """Enough for a plot, and with seven messages of some 30 bytes less than a tenth of a 57 600 baud radio. 0: none."""
    computer_status: bool = True
    """CPU, temperature, memory and disk of this computer once a second, as ONBOARD_COMPUTER_STATUS. Real vehicles."""


class DiskConfig(Written):
    """How much of the disk recorded flights of real vehicles may take; the oldest go first, those with a hit last."""

    max_use_mb: NotNegative | None = None
    """Megabytes (10^6 bytes) of all flights together. Unset: a tenth of the file system, at most 4 GiB, as journald's
    SystemMaxUse."""
    keep_free_mb: NotNegative | None = None
    """Megabytes that are left free. Unset: 300 MiB, or a tenth of a smaller file system, as PX4's logger leaves."""


class CompanionConfig(Written):
    """All settings of the companion."""

    detectors: ClassVar[Mapping[str, MakeDetector]] = DETECTORS
    """What `detector` may name. Whoever has others extends this class by them, and by a key for each one's settings."""

    detector: str = "fused"
    """Its own settings are those under its name."""
    min_detection_height_m: NotNegative = 0.5
    """Ground handling, landing gear and ground effect are below this height above the arming position: nothing is
    detected before a take-off has reached it, nor below it in a landing. In between a low flight is a flight."""
    fused: FusedConfig = FusedConfig()
    sight: SightConfig = SightConfig()
    streams: StreamsConfig = StreamsConfig()
    estimate: EstimateConfig = EstimateConfig()
    settled: SettledConfig = SettledConfig()
    link: LinkConfig = LinkConfig()
    flight: FlightConfig = FlightConfig()
    operator: OperatorConfig = OperatorConfig()
    disk: DiskConfig = DiskConfig()

    @property
    def least_threshold_m_s2(self) -> float | None:
        """What the chosen detector asks for sideways of a vehicle that does not shake; None if it looks at no force."""
        settings = getattr(self, self.detector)
        names = ("side_threshold_m_s2", "threshold_m_s2")
        return next((float(getattr(settings, name)) for name in names if hasattr(settings, name)), None)

    @model_validator(mode="before")
    @classmethod
    def _no_settings_of_baselines(cls, data: object) -> object:
        """They would have no effect; why not is said better than of any other unknown key."""
        for key in sorted(BASELINES.intersection(data) if isinstance(data, dict) else ()):
            check_known_detector(key, cls.detectors)
        return data

    @field_validator("detector")
    @classmethod
    def _known_detector(cls, name: str) -> str:
        check_known_detector(name, cls.detectors)
        return name
