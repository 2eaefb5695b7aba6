"""The estimate of an impact: a first one at detection, refined by the contact's force, final when that is over."""

import math
from dataclasses import dataclass, field, replace

from companion.messages import (
    Attitude,
    GpsFix,
    ImuSample,
    LocalPosition,
    Odometry,
    Quaternion,
    Sample,
    ScaledImu,
    Vector3,
)
from companion.motion.biases import TakenBiases
from companion.motion.config import SAME_M_S, STAMP_RESOLUTION_US
from companion.motion.doppler import Doppler
from companion.motion.rotation import body_to_ned
from companion.motion.vector import ZERO, along, minus, plus, unit
from companion.reflex.belief.motion_estimator import MotionEstimator
from companion.reflex.config import APPROACH_RAD, CLIPPED_SHARE, SHORT, EstimateConfig, RecoveryConfig
from companion.reflex.detection.detector import DetectorState, Evidence, Impact, Motion, Phase
from companion.reflex.surface import Contact, MotionState, Normal, away_from, normal_of


@dataclass(slots=True)
class ContactForce:
    """Changed only by `add`. Forces per unit mass, m/s^2; impulse per unit mass, m/s."""

    free_frd_m_s2: Vector3  # the accelerometer's value without the contact
    averaging_us: int
    range_m_s2: float
    impulse_ned_m_s: Vector3 = ZERO
    forces_ned_m_s2: list[Vector3] = field(default_factory=list)  # in samples above the threshold
    is_clipped: bool = False
    has_gap: bool = False  # whether samples are missing; PX4's own estimate does not lack them
    begun_boot_us: int | None = None

    def add(self, sample: ImuSample, elapsed_us: int, attitude_wxyz: Quaternion) -> None:
        """Take one IMU sample above the threshold, so long after the one before it, and the attitude at its time.

        The first one comes so long after the latest time without contact.
        """
        f = sample.specific_force_frd_m_s2
        force = body_to_ned(attitude_wxyz, minus(f, self.free_frd_m_s2))
        # Of the time before the first sample only its own window is known.
        elapsed_s = 1e-6 * (elapsed_us if self.forces_ned_m_s2 else min(elapsed_us, self.averaging_us))
        is_contiguous = elapsed_us < 2 * self.averaging_us  # less than one window is missing
        self.has_gap |= not is_contiguous
        self.is_clipped |= max(map(abs, f)) >= CLIPPED_SHARE * self.range_m_s2
        self.impulse_ned_m_s = plus(self.impulse_ned_m_s, elapsed_s, force)
        self.forces_ned_m_s2.append(force)
        if len(self.forces_ned_m_s2) == 2 and is_contiguous:
            # The contact began within the first window: its mean is that share of the second window's.
            first_m_s2, second_m_s2 = (math.hypot(*each) for each in self.forces_ned_m_s2)
            share = min(1.0, first_m_s2 / second_m_s2) if second_m_s2 > 0.0 else 1.0
            self.begun_boot_us = sample.time_boot_us - elapsed_us - round(share * self.averaging_us)

    def is_fully_measured(self, is_over: bool, came_ned_m_s: Vector3) -> bool:
        """Whether the force so far was measured without clipping, as far as the samples and v_c show."""
        if self.is_clipped:
            return False
        largest = max(self.forces_ned_m_s2, key=lambda force: math.hypot(*force))
        least = 0.5 * along(largest, largest)
        lasting = sum(along(force, largest) >= least for force in self.forces_ned_m_s2)
        impulse_m_s = self.impulse_ned_m_s
        off_m_s = along(plus(came_ned_m_s, 1.0, impulse_m_s), unit(impulse_m_s))
        # One that is over and has not even stopped the vehicle's way into it lacks some: a chattering frame's pulses
        # are short, and each is clipped.
        return lasting > SHORT and not (is_over and off_m_s < -SAME_M_S)


@dataclass(frozen=True, slots=True)
class ImpactEstimate:
    """One impact. Times are the vehicle's boot clock, vectors local NED, SI."""

    impact: Impact
    time_boot_us: int  # t_c
    time_error_us: int  # either way
    position_ned_m: Vector3  # x(t_c)
    velocity_ned_m_s: Vector3  # v_c: just before the contact
    normal: Normal
    peak_specific_force_m_s2: float  # the largest in one IMU sample
    impulse_m_s: float  # of the contact, per unit mass
    velocity_error_m_s: float = 0.0  # standard deviation on an axis
    is_fully_measured: bool = False  # nothing was clipped; else the vehicle's own estimate may lack a part of the hit
    is_lower_bound: bool = True  # peak and impulse may be larger: something was clipped, or samples are missing
    is_final: bool = False  # the contact is over
    earlier: ImuSample | None = None  # the one before the first that shows it
    after: MotionEstimator | None = None  # the motion since then, of a collision


@dataclass(slots=True)
class ImpactEstimator(Motion):
    """Takes all samples, and refines the estimate of the latest impact with each. Times: vehicle's boot clock."""

    config: EstimateConfig
    recovery: RecoveryConfig = field(default_factory=RecoveryConfig)
    doppler: Doppler = field(default_factory=Doppler)
    biases: TakenBiases = field(default_factory=TakenBiases)
    imu: ImuSample | None = None
    earlier_imu: ImuSample | None = None
    estimate: ImpactEstimate | None = None
    contact: ContactForce | None = None

    def update(self, sample: Sample) -> None:
        """Take one sample of any kind."""
        if isinstance(sample, ImuSample):
            f, w = sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s
            elapsed_us = sample.time_boot_us - self.strapdown.time_boot_us
            self.lever.imu(elapsed_us, f, w, 1e6 * self.config.imu_averaging_interval_s)
            self.strapdown.imu(sample.time_boot_us, f, w, self.lever.force_frd_m_s2)
            self.strapdown.sensor_frd_m = self.lever.place_frd_m
            self.earlier_imu, self.imu = self.imu, sample
            for after in self.followed:
                after.imu(self.strapdown)
            if self.followed and self.followed[0].has_faded:
                del self.followed[0]
        elif isinstance(sample, (LocalPosition, Odometry)):
            self.strapdown.velocity(sample)
            if isinstance(sample, LocalPosition) and self.history.add(sample):
                for after in self.followed:
                    after.update(sample)
        elif isinstance(sample, GpsFix):
            is_free = self.is_valid and (self.estimate is None or self.estimate.is_final)
            self.doppler.take(sample, self.strapdown, self.history.latest, is_free)
            for after in self.followed:
                after.measure(self.doppler)
        elif isinstance(sample, ScaledImu):
            self.biases.take(sample, not self.followed)
        elif isinstance(sample, Attitude):
            most_wrong_rad = 0.0 if self.after is None else self.after.tilt_error_rad(sample.time_boot_us)
            self.strapdown.attitude(sample.time_boot_us, sample.attitude_wxyz, most_wrong_rad)

    def begin(self, impact: Impact) -> ImpactEstimate:
        """The first estimate of a new impact: the motion before it, and the force of its first sample or velocity."""
        sample_us, free_until_us = impact.sample_time_boot_us, impact.contact_free_until_boot_us
        place, velocity, error_m_s = ZERO, ZERO, math.inf
        # What comes later may lack a part of the hit: after a stiff contact PX4's estimate is not valid.
        latest = self.history.before(free_until_us - STAMP_RESOLUTION_US)
        if latest is not None:
            velocity, error_m_s = latest.velocity_ned_m_s, self.config.velocity_noise_m_s
            place = plus(latest.position_ned_m, 1e-6 * (free_until_us - latest.time_boot_us), velocity)
        force_ned = body_to_ned(self.strapdown.valid_wxyz, impact.specific_force_frd_m_s2)
        size = math.hypot(*force_ned)
        self.contact = self._contact_force(impact)
        normal = normal_of(force_ned, velocity, self.hides_clipping)
        if impact.evidence is Evidence.RATE_JUMP:
            # Of the way that the vehicle came.
            normal = Normal().with_direction(force_ned, APPROACH_RAD)
        estimate = ImpactEstimate(
            impact=impact,
            time_boot_us=(free_until_us + sample_us) // 2,
            time_error_us=(sample_us - free_until_us) // 2,
            position_ned_m=place,
            velocity_ned_m_s=velocity,
            normal=normal,
            peak_specific_force_m_s2=size,
            impulse_m_s=size * 1e-6 * (sample_us - free_until_us),
            velocity_error_m_s=error_m_s,
            earlier=self.earlier_imu,
        )
        if impact.is_collision:
            after = self.motion_after(estimate)
            estimate, self.followed = replace(estimate, after=after), [*self.answered, after]
        self.estimate = estimate
        return estimate

    def motion_after(self, estimate: ImpactEstimate) -> MotionEstimator:
        """Begin to follow the motion after a collision; before it, too, where an earlier one is still corrected."""
        before, first_us, normal = self.after, estimate.impact.sample_time_boot_us, estimate.normal
        motion, error_m_s = MotionState(estimate.position_ned_m, estimate.velocity_ned_m_s), estimate.velocity_error_m_s
        if before is not None and not before.is_valid:
            motion, error_m_s = before.motion, before.spread_m_s
        place, velocity = motion.position_ned_m, motion.velocity_ned_m_s
        contact = Contact(place, velocity, away_from(normal.direction_ned), normal.error_rad, error_m_s)
        expected, fits_models = contact.rebound(self.recovery.restitution), not self.hides_clipping
        after = MotionEstimator(contact, first_us, expected, self.config, before, fits_models)
        after.note_contact(estimate.is_fully_measured, first_us, normal, estimate.impulse_m_s)
        return after

    def _contact_force(self, impact: Impact) -> ContactForce | None:
        """Of a contact that a turn shows the first force is still to come; one that a velocity shows is over."""
        imu, is_shown = self.imu, impact.evidence is Evidence.FORCE
        if imu is None or impact.evidence is Evidence.VELOCITY_JUMP:
            return None
        free = impact.free_frd_m_s2 or minus(imu.specific_force_frd_m_s2, impact.specific_force_frd_m_s2)
        averaging_us = round(self.config.imu_averaging_interval_s * 1e6)
        contact = ContactForce(free, averaging_us, self.config.accelerometer_range_m_s2)
        contact.is_clipped = self.hides_clipping or not is_shown
        if is_shown:
            contact.add(imu, imu.time_boot_us - impact.contact_free_until_boot_us, self.strapdown.valid_wxyz)
        return contact

    def follow(self, sample: ImuSample, state: DetectorState) -> None:
        """Take an IMU sample, and the detector's state after it, until the estimate is final: the contact is over."""
        estimate, contact, is_over = self.estimate, self.contact, state.phase is not Phase.CONTACT
        assert estimate is not None, "an impact has begun"
        if contact is not None and self.earlier_imu is not None and state.last_loud_boot_us == sample.time_boot_us:
            contact.add(sample, sample.time_boot_us - self.earlier_imu.time_boot_us, self.strapdown.valid_wxyz)
            if contact.begun_boot_us is not None and estimate.impact.evidence is Evidence.FORCE:
                error_us = contact.averaging_us // 4
                estimate = replace(estimate, time_boot_us=contact.begun_boot_us, time_error_us=error_us)
            estimate = replace(
                estimate,
                normal=normal_of(contact.impulse_ned_m_s, estimate.velocity_ned_m_s, self.hides_clipping),
                peak_specific_force_m_s2=max(math.hypot(*force) for force in contact.forces_ned_m_s2),
                impulse_m_s=math.hypot(*contact.impulse_ned_m_s),
            )
        if contact is not None:
            # With each sample: arms may meet their stop, and clip the sensor, late in the contact.
            is_whole = contact.is_fully_measured(is_over, estimate.velocity_ned_m_s)
            is_lower_bound = contact.has_gap or not is_whole
            estimate = replace(estimate, is_fully_measured=is_whole, is_lower_bound=is_lower_bound)
        self.estimate = replace(estimate, is_final=is_over)
        if estimate.after is not None:
            is_whole, impulse_m_s = estimate.is_fully_measured, estimate.impulse_m_s
            estimate.after.note_contact(is_whole, state.last_loud_boot_us, estimate.normal, impulse_m_s)
