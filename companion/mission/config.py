"""The mission's `companion:` part: every key optional, every default with its reason."""

from typing import Annotated

from pydantic import Field

from companion.motion.config import SettledConfig
from companion.reflex.detection.monitor import CollisionMonitorConfig
from companion.strict_model import NotNegative, Positive, StrictModel

Rate = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0, le=1000.0)]


class StreamsConfig(StrictModel):
    """Rates asked for, and the least measured rates with which a flight begins, in Hz."""

    highres_imu_hz: Rate = 250.0
    """PX4 rounds the interval to whole IMU samples: 200 gives 124, 250 gives all of them (measured on SITL)."""
    local_position_hz: Rate = 50.0
    """A velocity at most 20 ms before a contact: v_c is the last one (see detection.impact)."""
    attitude_hz: Rate = 50.0
    """Which way the thrust points, and how the vehicle turns."""
    extended_sys_state_hz: Rate = 5.0
    """Take-off and touchdown last longer than a second."""
    attitude_target_hz: Rate = 30.0
    """The thrust asked for changes by less than a third of the greatest within 33 ms (see detection.free_flight).
    Asked for only by a detector that uses it."""
    odometry_hz: Rate = 30.0
    """PX4's own rate on an onboard link; only its reset counter and microsecond stamps are made use of."""
    vibration_hz: Rate = 1.0
    """For `rebound preflight`: cumulative counts; twice a second is PX4's own rate."""
    current_mode_hz: Rate = 10.0
    """Mode changes are acted on within a tenth of a second."""
    gps_raw_int_hz: Rate = 10.0
    """The receiver's own velocity and place, which no hit can falsify; receivers have 5 to 10 Hz."""
    window_s: Positive = 2.0
    """Long enough to see 80 samples of the slowest acceptable IMU stream."""
    min_highres_imu_hz: NotNegative = 40.0
    """PX4's onboard default is 50 Hz; below 40 Hz more than 80 % of a 25 ms contact can fall between samples."""
    min_local_position_hz: Positive = 10.0
    """A tenth of a second between positions is 0.2 m at 2 m/s, the most a setpoint may be wrong by."""
    min_attitude_hz: Positive = 10.0
    """A tenth of a second of turning at 1 rad/s is 6 degrees."""


class LinkConfig(StrictModel):
    """Patience with the other end."""

    heartbeat_wait_s: Positive = 10.0
    """For a vehicle's first HEARTBEAT, which PX4 sends once a second, then for the streams that a flight needs. PX4
    sends no attitude before its estimator has aligned itself."""
    wait: bool = False
    """On the ground, wait without end for a vehicle that is missing, restarts, or has no position yet (`--wait`)."""
    silence_s: Annotated[Positive, Field(ge=0.2)] = 1.5
    """More than the one-second HEARTBEAT interval, so that a lost packet is not a lost link, and still sooner
    than anyone notices a vehicle flying on its own."""
    position_silence_s: Annotated[Positive, Field(ge=0.1)] = 1.0
    """A position this old is 2 m wrong at 2 m/s: nothing flown on it is safe."""


class FlightConfig(StrictModel):
    """How the flight itself is flown."""

    setpoint_hz: Annotated[Rate, Field(ge=20.0)] = 50.0
    """Well above the 2 Hz that holds OFFBOARD; 50 Hz so that a moving setpoint advances 4 cm a step at 2 m/s."""
    setpoint_lead_s: Annotated[Positive, Field(ge=1.0)] = 1.0
    """PX4 wants to see the stream before the switch; its documentation asks for more than a second of it."""
    takeoff_speed_m_s: Annotated[Positive, Field(le=3.0)] = 1.0
    """Below PX4's limit of 3 m/s and near its own take-offs' 1.5 m/s."""
    takeoff_acceleration_m_s2: Annotated[Positive, Field(le=5.0)] = 1.0
    """Of the beginning and the end of the climb."""
    cruise_speed_m_s: Annotated[Positive, Field(le=12.0)] = 1.0
    """Of items that state no speed: a quick walk, at which a hit does no harm to an airframe with guards."""
    cruise_acceleration_m_s2: Annotated[Positive, Field(le=9.81)] = 2.0
    """A tilt of 11 degrees, well inside every multicopter's."""
    speeding_up_m_s2: Annotated[Positive, Field(le=9.81)] = 1.0
    """The most, of any item's acceleration, with which the horizontal velocity grows or turns. A vehicle that leans
    into its way, or into a bend, is hit below its centre and tips: beyond 10 degrees at 3 m/s, or 16 at 1 m/s, its
    thrust then pins it to the obstacle (docs/explanation/recovery.md). This leans it by 6, and what a head wind leans
    it by is taken off it; drag comes on top. Braking leans it the other way."""
    acceptance_radius_m: Positive = 0.5
    """A waypoint is passed, not settled on. A PX4 that flies by GPS wanders by this much around a setpoint (its own
    simulator's noise moves a hover by 0.5 m); a quarter of it could be missed for a long time."""
    arrival_timeout_s: Positive = 15.0
    """Time allowed to arrive after the profile has ended: a wind or a drag it did not know of."""


class OperatorConfig(StrictModel):
    """What a ground station is told; nothing of it is needed to fly."""

    status_texts: bool = True
    """Hits, recoveries, limits and the outcome, as STATUSTEXT."""
    values_hz: Annotated[NotNegative, Field(le=50.0)] = 2.0
    """Enough for a plot, and with seven messages of some 30 bytes less than a tenth of a 57 600 baud radio; 0: none."""
    computer_status: bool = True
    """CPU, temperature, memory and disk of this computer once a second, as ONBOARD_COMPUTER_STATUS. Real vehicles."""


class DiskConfig(StrictModel):
    """How much of the disk recorded flights of real vehicles may take; the oldest go first, those with a hit last."""

    max_use_mb: NotNegative | None = None
    """Megabytes (10^6 bytes) of all flights together; unset: a tenth of the file system, at most 4 GiB, as journald's
    SystemMaxUse."""
    keep_free_mb: NotNegative | None = None
    """Megabytes that are left free; unset: 300 MiB, or a tenth of a smaller file system, as PX4's logger leaves."""


class CompanionConfig(CollisionMonitorConfig):
    """All settings of the companion."""

    min_detection_height_m: NotNegative = 0.5
    """Ground handling, landing gear and ground effect are below this height above the arming position: nothing but a
    crash is detected before a take-off has reached it."""
    streams: StreamsConfig = StreamsConfig()
    settled: SettledConfig = SettledConfig()
    link: LinkConfig = LinkConfig()
    flight: FlightConfig = FlightConfig()
    operator: OperatorConfig = OperatorConfig()
    disk: DiskConfig = DiskConfig()
