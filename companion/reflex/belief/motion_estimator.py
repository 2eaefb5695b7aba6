"""Position and velocity of a vehicle after a hit, although its own estimate may lack a part of the hit.

A clipped accelerometer hides a part of the impulse. That part is missing in the vehicle's own velocity, and then in its
position, until other sensors correct both. At a time t after the hit the vehicle reports

    v(t) + e g(t),    x(t) + e G(t)

for its velocity v and position x, where e is the error just after the hit (see `filter_bank`). Between two reports the
accelerometer is integrated. A bank of Kalman filters estimates x, v and e, each by one hypothesis of g and G, and
weighted by the likelihood of its innovations (Magill 1965). Before the first report v is the expected rebound.
"""

import math
from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field

import numpy as np

from companion.messages import LocalPosition, Quaternion, Vector3
from companion.motion import config as numbers
from companion.motion.config import GRAVITY_M_S2, SAME_M_S
from companion.motion.doppler import Doppler, MeasuredMotion
from companion.motion.rotation import body_to_ned, swept_ned, turned
from companion.motion.settling import Lasting
from companion.motion.strapdown import LEVEL, Strapdown
from companion.motion.vector import ZERO, along, flat, minus, plus, split, towards
from companion.reflex import config as reflex
from companion.reflex.belief.filter_bank import FilterBank, error_response
from companion.reflex.surface import Contact, MotionState, Normal, away_from


@dataclass(frozen=True, slots=True)
class Belief:
    """The vehicle's motion and attitude as the companion knows them; local NED, body FRD."""

    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    spread_m_s: float = 0.0  # standard deviation of the velocity
    tilt_m_s2: Vector3 = ZERO  # horizontal acceleration of the thrust, TILT_AHEAD_S ahead
    external_m_s2: Vector3 = ZERO  # horizontal acceleration by wind
    attitude_wxyz: Quaternion = LEVEL
    yaw_rate_rad_s: float = 0.0
    level_m_s2: Vector3 = ZERO  # acceleration of a vehicle that is level by its own attitude
    heading_error_rad: float = 0.0  # of the vehicle's own attitude


@dataclass(slots=True)
class MotionEstimator:
    """Local NED, SI, the vehicle's boot clock. Changed only by its methods."""

    contact: Contact
    hit_boot_us: int  # its first sample
    start: MotionState  # the expected motion after it
    config: reflex.EstimateConfig
    before: InitVar["MotionEstimator | None"] = None  # of an earlier hit
    fits_models: bool = True  # the vehicle's estimate corrects itself as one of the bank's models
    left_before_m_s: float = 0.0  # what the vehicle's velocity still had wrong by an earlier hit
    hardest_m_s: float = field(init=False)  # speed of the hit, or of such an earlier one
    motion: MotionState = field(init=False)
    normal: Normal = field(init=False)  # by the contact's force
    pushed_boot_us: int = field(init=False)  # the contact's last sample
    is_answered: bool = False  # by a recovery
    is_fully_measured: bool = False  # nothing was clipped: the vehicle's estimate contains the whole hit
    has_converged: bool = False  # what is wrong of the vehicle's own estimate is known
    known_wind_m_s2: Vector3 = ZERO  # horizontal specific force across the thrust, as in the last hover before it
    external_m_s2: Vector3 = ZERO  # and by now
    wind_m_s2: Vector3 = ZERO  # of that what lasts: drag is none at rest
    level_m_s2: Vector3 = ZERO  # acceleration of a vehicle that is level by its own attitude, by gyroscopes, NED
    _sinks_m_s2: float = 0.0  # by how much less than by its own attitude its thrust lifts
    spread_m_s: float = 0.0  # largest standard deviation of the motion's velocity
    position_error_m: Vector3 = ZERO  # of the newest reported position
    velocity_error_m_s: Vector3 = ZERO  # and of the reported velocity
    after_ned_m_s: Vector3 = ZERO  # the velocity just after the contact, by when it was known best
    after_error_m_s: float = math.inf  # its standard deviation; infinite until it is known
    _expected_within_m_s: float = field(init=False)  # standard deviation of the expected motion's velocity
    _bank: FilterBank | None = None  # from the first report on
    _summed_m_s: Vector3 = ZERO  # the accelerometer's integral, as at the vehicle's centre
    _turned_from: tuple[Quaternion, Vector3] | None = None  # attitude and rates at the contact's last sample of 1 g
    _shown_m_s: Vector3 = ZERO  # the integral up to that sample, and from there on as at the accelerometer
    _smoothed_m_s2: Vector3 = ZERO  # what it shows, low-pass filtered
    _released_m_s: Vector3 = ZERO  # the integral up to the contact's last sample
    _time_boot_us: int = field(init=False)  # of the newest sample of the accelerometer
    _swings_m_s: float = 0.0  # standard deviation of its further swing, by the bank
    _measured: MeasuredMotion | None = None  # by a receiver, since the contact's last sample
    _was_odd: bool = False  # whether its last velocity was beyond belief: a second one counts
    _has_agreed: bool = False  # with the measured one, by itself
    _same: Lasting = field(default_factory=Lasting)  # for how long the reported velocity has been the measured one

    def __post_init__(self, before: "MotionEstimator | None") -> None:
        self.hardest_m_s = math.hypot(*self.contact.velocity_ned_m_s)
        if before is not None and not before.is_valid:
            self.hardest_m_s = max(self.hardest_m_s, before.hardest_m_s)
            self.left_before_m_s = before.left_m_s
        self.motion, self.pushed_boot_us, self._time_boot_us = self.start, self.hit_boot_us, self.hit_boot_us
        self.normal = Normal(self.contact.normal_ned, self.contact.normal_error_rad)
        self._begin()

    def note_wind(self, known_m_s2: Vector3) -> None:
        """Take the horizontal specific force across the thrust of the last hover before the hit."""
        self.known_wind_m_s2 = self.external_m_s2 = self.wind_m_s2 = known_m_s2

    def _begin(self, impulse_m_s: float = 0.0) -> None:
        self._bank, self._measured, self._same = None, None, Lasting()
        self.has_converged = self._has_agreed = self._was_odd = False
        came_m_s = math.hypot(*self.contact.velocity_ned_m_s)
        # Beyond an elastic rebound the obstacle moved, nobody knows how fast: as much again may be hidden.
        moved_m_s = impulse_m_s if impulse_m_s > 2.0 * came_m_s else 0.0
        self.spread_m_s = self._expected_within_m_s = SAME_M_S + reflex.SPREAD * came_m_s + moved_m_s
        self.position_error_m = self.velocity_error_m_s = ZERO
        self._swings_m_s, self.after_error_m_s = 0.0, math.inf

    def note_contact(self, is_fully_measured: bool, pushed_boot_us: int, normal: Normal, impulse_m_s: float) -> None:
        """Take what is known of the contact by now: whether it was measured whole, its last sample's time, its normal
        by the force, its impulse per mass."""
        was_measured, is_pushed = self.is_fully_measured, pushed_boot_us > self.pushed_boot_us
        self.is_fully_measured, self.normal = is_fully_measured and not self.is_second, normal
        if is_pushed:
            self.pushed_boot_us, self._released_m_s = pushed_boot_us, self._summed_m_s
            self.after_error_m_s = math.inf
        if not self.is_fully_measured and (is_pushed or was_measured):
            self._begin(impulse_m_s)

    def imu(self, strapdown: Strapdown) -> None:
        """Integrate the newest sample. More than 1 g beside the thrust is the contact, which `start` contains."""
        time_us, elapsed_s = strapdown.time_boot_us, 1e-6 * (strapdown.time_boot_us - self._time_boot_us)
        self._time_boot_us = time_us
        self.level_m_s2, self._sinks_m_s2 = strapdown.level_acceleration_m_s2, strapdown.sinks_m_s2
        if not 0.0 < elapsed_s < 1e-6 * numbers.LONGEST_GAP_US:
            return
        force = body_to_ned(strapdown.valid_wxyz, strapdown.centre_frd_m_s2)
        pushed = plus(force, GRAVITY_M_S2, (0.0, 0.0, 1.0))
        x, y, z = strapdown.centre_frd_m_s2  # thrust has no part in x and y, nor in a positive z
        is_free, last = math.hypot(x, y, max(z, 0.0)) < GRAVITY_M_S2, self._summed_m_s
        weight = elapsed_s / (reflex.SMOOTHED_S + elapsed_s)
        self._smoothed_m_s2 = towards(self._smoothed_m_s2, pushed if is_free else ZERO, weight)
        if not is_free or self._turned_from is None:
            self._turned_from, self._shown_m_s = (strapdown.valid_wxyz, strapdown.rates_frd_rad_s), last
        if is_free:
            self._shown_m_s = plus(self._shown_m_s, elapsed_s, strapdown.acceleration_ned_m_s2)
            # The newest place of the accelerometer counts for all of the turn.
            began_m_s = swept_ned(*self._turned_from, strapdown.sensor_frd_m)
            self._summed_m_s = plus(self._shown_m_s, -1.0, minus(strapdown.turns_ned_m_s, began_m_s))
        self._carry_on(elapsed_s, minus(self._summed_m_s, last))
        since_s = 1e-6 * (time_us - self.pushed_boot_us)
        if since_s > reflex.SMOOTHED_S:
            # Drag changes with the speed, until it rests; then wind is left.
            memory_s = min(max(since_s, reflex.SMOOTHING_S), reflex.FOLLOWED_S)
            down = body_to_ned(strapdown.valid_wxyz, (0.0, 0.0, 1.0))
            share = elapsed_s / (memory_s + elapsed_s)
            self.external_m_s2 = towards(self.external_m_s2, flat(split(force, down)[1]), share)
            if self.contact_m_s2 == ZERO:
                share = elapsed_s / (reflex.FOLLOWED_S + elapsed_s)
                self.wind_m_s2 = towards(self.wind_m_s2, self.external_m_s2, share)

    def _carry_on(self, elapsed_s: float, faster_m_s: Vector3) -> None:
        place, velocity = self.motion.position_ned_m, self.motion.velocity_ned_m_s
        place = plus(place, elapsed_s, plus(velocity, 0.5, faster_m_s))
        self.motion = MotionState(place, plus(velocity, 1.0, faster_m_s))

    @property
    def is_second(self) -> bool:
        """Whether the error of an earlier hit was still being corrected."""
        return self.left_before_m_s > 0.0

    @property
    def _new_m_s2(self) -> Vector3:
        """External force per mass across the thrust that was not there before the hit."""
        return minus(self.external_m_s2, self.known_wind_m_s2)

    @property
    def contact_m_s2(self) -> Vector3:
        """External force per mass across the thrust, horizontal, by what is touched; zero where it may be wind.

        One that ends is no push the other way.
        """
        new, all_m_s2 = self._new_m_s2, self.external_m_s2
        least_m_s2 = min(math.hypot(*new), math.hypot(*all_m_s2))
        if least_m_s2 <= reflex.PRESSES_M_S2:
            return ZERO
        # What pushes off what was hit is that, sooner than wind.
        normal = away_from(self.normal.direction_ned)
        off_m_s2 = min(along(new, normal), along(all_m_s2, normal))
        return new if least_m_s2 > reflex.HELD_M_S2 or off_m_s2 > reflex.PRESSES_M_S2 else ZERO

    def belief(self, strapdown: Strapdown) -> Belief:
        """What the attitude law goes by."""
        motion = self.motion
        ahead_wxyz = turned(strapdown.valid_wxyz, strapdown.rates_frd_rad_s, reflex.TILT_AHEAD_S)
        n, e, d = body_to_ned(ahead_wxyz, (0.0, 0.0, -GRAVITY_M_S2))
        upright = max(-d / GRAVITY_M_S2, reflex.UPRIGHT_COSINE)
        return Belief(
            motion.position_ned_m,
            motion.velocity_ned_m_s,
            self.spread_m_s,
            (n / upright, e / upright, 0.0),
            self.wind_m_s2,
            strapdown.valid_wxyz,
            strapdown.rates_frd_rad_s[2],
            self.tilted_m_s2,
            strapdown.heading_error_rad,
        )

    @property
    def tilted_m_s2(self) -> Vector3:
        """Acceleration of a vehicle that is level by its own attitude, by gyroscopes and receiver, NED."""
        return self.level_m_s2 if self._measured is None else plus(self.level_m_s2, 1.0, self._measured.unseen_m_s2)

    def measure(self, doppler: Doppler) -> None:
        """Take a receiver's velocity and place: the horizontal ones from then on, until the vehicle's own agrees."""
        was = self._measured
        newest_us = self.pushed_boot_us if was is None else was.taken_boot_us
        needs_none = self.is_fully_measured or (self.has_converged and was is None)
        if needs_none or doppler.taken_boot_us <= newest_us or self._is_of_before(doppler):
            return
        # It begins with what was expected: reports may be wrong in a way that no model has.
        spreads = reflex.PLACE_SPREAD_M, self._expected_within_m_s
        start = self.start.position_ned_m, self.start.velocity_ned_m_s
        known = was or MeasuredMotion(self.hit_boot_us, *start, spreads)
        known.predict(self._time_boot_us, self._summed_m_s)
        was_odd, self._was_odd = self._was_odd, known.update(doppler, self._was_odd)
        if self._was_odd and not was_odd:
            return
        self._measured = known
        if not self._has_agreed:
            self._believe(self.motion, self.spread_m_s)

    def _is_of_before(self, doppler: Doppler) -> bool:
        """Whether a receiver shows what no vehicle does, and so is late: that it goes on into what it has hit."""
        normal, is_new = away_from(self.normal.direction_ned), self._since_s < numbers.RECEIVER_LATEST_S
        left_ned_m_s = minus(doppler.velocity_ned_m_s, self._flown_m_s)
        return is_new and along(left_ned_m_s, normal) < 0.5 * along(self.contact.velocity_ned_m_s, normal)

    @property
    def _since_s(self) -> float:
        """Time since the contact's last sample."""
        return 1e-6 * (self._time_boot_us - self.pushed_boot_us)

    @property
    def _flown_m_s(self) -> Vector3:
        """The accelerometer's integral since then."""
        return minus(self._summed_m_s, self._released_m_s)

    @property
    def is_valid(self) -> bool:
        """Whether the vehicle's own estimate is right, its tilt, too: the hit was measured whole, or is long past."""
        is_past = self._time_boot_us - self.hit_boot_us > reflex.CORRECTED_US
        return self.is_fully_measured or (is_past and not self.is_measured_apart)

    @property
    def has_faded(self) -> bool:
        """Whether nothing of it has to be known any more."""
        return self._time_boot_us - self.hit_boot_us > reflex.FADED_US and not self.is_measured_apart

    def tilt_error_rad(self, time_us: int) -> float:
        """By how much the reported tilt may be wrong: 0 if no hit is being corrected, or the correction cannot have
        begun."""
        is_early = not self.is_second and time_us - self.hit_boot_us < numbers.SHOWN_US
        is_right = self.is_fully_measured or self.has_faded or is_early
        return 0.0 if is_right else min(numbers.TILT_RAD_PER_M_S * (1.0 + self.hardest_m_s), reflex.TIPPED_RAD)

    def correction_m_s(self, times_us: Sequence[int], left_m_s: float) -> float:
        """By how much the newest of these velocities may differ from the mean of the others, because the hit is being
        corrected: by what was left of it before, or an elastic one that was hidden whole, by the worst model of an
        estimator. What struck a vehicle that stood still may have done so at any speed."""
        if self.is_valid:
            return 0.0
        if self.hardest_m_s < reflex.SLOW_M_S or self.is_measured_apart:
            return left_m_s
        *earlier, newest = (error_response(1e-6 * (each - self.hit_boot_us))[0] for each in times_us)
        swing_m_s = 2.0 * self.hardest_m_s * float(np.abs(newest - sum(earlier) / len(earlier)).max())
        return min(swing_m_s, left_m_s)

    @property
    def is_measured_apart(self) -> bool:
        """Whether a receiver shows the velocity, and the vehicle's own is another, which it puts right by itself."""
        if self._measured is None or self._is_right:
            return False
        return self._time_boot_us - self._measured.taken_boot_us < numbers.CURRENT_US

    @property
    def left_m_s(self) -> float:
        """By how much the reported velocity may be wrong; infinite until that is known."""
        if not self.has_converged:
            return math.inf
        return SAME_M_S + math.hypot(*self.velocity_error_m_s) + reflex.SURE * self._swings_m_s

    def _believe(self, motion: MotionState, spread_m_s: float) -> None:
        """The motion by the reports; horizontally by a receiver, where there is one."""
        self.motion, self.spread_m_s = motion, spread_m_s
        if self._measured is not None and self.is_measured_apart:
            self._measured.predict(self._time_boot_us, self._summed_m_s)
            (x, y), (u, v), _ = self._measured.state.tolist()
            (*_, z), (*_, w) = motion.position_ned_m, motion.velocity_ned_m_s
            self.motion, self.spread_m_s = MotionState((x, y, z), (u, v, w)), math.sqrt(self._measured.covariance[1, 1])
        self._look_back()

    def _look_back(self) -> None:
        """The velocity just after the contact: the present one less what the accelerometer has shown since."""
        error_m_s = math.hypot(self.spread_m_s, numbers.LEVEL_SPREAD_M_S2 * self._since_s)
        if error_m_s < self.after_error_m_s:
            self.after_ned_m_s = minus(self.motion.velocity_ned_m_s, self._flown_m_s)
            self.after_error_m_s = error_m_s

    @property
    def _is_right(self) -> bool:
        """Whether the vehicle's own estimate contains the whole hit by now."""
        return self.is_fully_measured or self._has_agreed

    def update(self, sample: LocalPosition) -> None:
        """Take the vehicle's reported position and velocity."""
        at_us = sample.time_boot_us - round(1e6 * numbers.DELAY_S)
        if at_us > self.hit_boot_us and (self._is_right or sample.time_boot_us > self.pushed_boot_us):
            self._filter(sample, at_us)

    def _filter(self, sample: LocalPosition, at_us: int) -> None:
        """Update the bank by one report. What is wrong of it is known once the swing that is left is small enough."""
        now_us, bank = self._time_boot_us, self._bank
        before_us = self.hit_boot_us if bank is None else bank.time_boot_us
        if abs(now_us - at_us) > numbers.LONGEST_GAP_US or now_us <= before_us:
            # The report's time is outside the integrated interval.
            return
        config, elapsed_s, behind_s = self.config, 1e-6 * (now_us - before_us), 1e-6 * (now_us - at_us)
        # Clipping hides between none and all of the change of velocity.
        half = plus(ZERO, 0.5, minus(self.contact.velocity_ned_m_s, self.start.velocity_ned_m_s))
        if bank is None:
            bank = self._bank = FilterBank(self.start, self.spread_m_s, half, self.hit_boot_us)
        level_m_s2 = self.level_m_s2
        if self._is_right:
            bank.drop_errors()
            half = level_m_s2 = ZERO
        elif not self.fits_models:
            # By a wrong tilt a vehicle that leans reports a climb that there is none of. PX4 corrects its own sooner.
            level_m_s2 = plus(level_m_s2, self._sinks_m_s2, (0.0, 0.0, 1.0))
        bank.predict(now_us, self._summed_m_s, level_m_s2)
        g, way_s, left = error_response(1e-6 * (at_us - self.hit_boot_us))
        # The report as of now.
        place = plus(sample.position_ned_m, behind_s, sample.velocity_ned_m_s)
        velocity = plus(sample.velocity_ned_m_s, behind_s, self._smoothed_m_s2)
        # An error with correlation time tau repeats in 2 tau / spacing samples: their variance is increased by that.
        colour = max(1.0, 2.0 * config.velocity_correlation_s / max(elapsed_s, 1e-6 * numbers.STAMP_RESOLUTION_US))
        # What a model lacks of a place lasts, too; a place's own error does not.
        place_colour = 1.0 if self.has_converged else colour
        # No estimator follows one of the models exactly; the difference is a share of the hidden velocity.
        off_m_s = math.hypot(*half) * reflex.MODEL_ERROR
        off_m = off_m_s * min(1e-6 * (at_us - self.hit_boot_us), 1.0)
        right_place = minus(place, self.position_error_m) if self._has_agreed else place
        bank.update(0, way_s + behind_s * g, right_place, place_colour * (config.position_noise_m**2 + off_m**2))
        bank.update(1, g, velocity, colour * (config.velocity_noise_m_s**2 + off_m_s**2))
        normal = away_from(self.normal.direction_ned)
        bank.leave(normal, along(self._summed_m_s, normal), self.normal.error_rad)
        motion, spread_m_s, self._swings_m_s = bank.estimate(left)
        # Of the height the report is right sooner than any model: a barometer shows no hit.
        is_led = self._measured is not None and not self._has_agreed
        n, e, _ = self.motion.position_ned_m if is_led else motion.position_ned_m
        estimate = MotionState((n, e, place[2]), motion.velocity_ned_m_s)
        is_apart, is_calm = self.is_measured_apart, self._swings_m_s <= SAME_M_S
        if not self.fits_models:
            # By then a receiver's velocity has come, where there is one.
            is_late = sample.time_boot_us - self.pushed_boot_us > numbers.CURRENT_US
            is_calm = is_calm and is_late and not is_apart
        self.has_converged = self._is_right or is_calm
        self._believe(estimate, 0.0 if self.has_converged else spread_m_s)
        if self.is_fully_measured:
            self.position_error_m = self.velocity_error_m_s = ZERO
            return
        self.velocity_error_m_s = minus(velocity, self.motion.velocity_ned_m_s)
        if is_apart or not self._has_agreed:
            self.position_error_m = flat(minus(place, self.motion.position_ned_m))
        if is_apart:
            self._compare(sample.time_boot_us)

    def _compare(self, time_boot_us: int) -> None:
        """Take a report beside what a receiver shows. Once the two have agreed for a while the receiver is needed no
        more, and the belief goes on by the report alone.
        """
        # `spread_m_s` is the measured one's.
        is_same = math.hypot(*flat(self.velocity_error_m_s)) <= math.hypot(SAME_M_S, self.spread_m_s)
        self._same.update(is_same, time_boot_us)
        # For as long as a receiver's velocity counts: a swing only passes through.
        if self._same.lasts_us > numbers.CURRENT_US:
            self._has_agreed = True
            self._bank = FilterBank(self.motion, self.spread_m_s, ZERO, self._time_boot_us, self._summed_m_s)
