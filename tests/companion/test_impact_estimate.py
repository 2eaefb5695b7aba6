"""v_c with the accelerometer's help, the push's impulse, the obstacle's normal: each against motion made by hand."""

import math
import random
from dataclasses import replace

import numpy as np
import pytest

from companion.detection.interface import ImpactKind, Situation
from companion.estimate import approach, guards, normal
from companion.estimate.config import EstimateConfig, GuardsConfig
from companion.estimate.contact_force import ContactForce
from companion.estimate.facing import final_normal
from companion.estimate.hypotheses import Touch
from companion.estimate.impact import ImpactEstimator
from companion.estimate.normal import normal_of
from companion.messages import Attitude, ImuSample, LandedState, LocalPosition, Odometry, Sample, Vibration
from companion.mission.config import CompanionConfig
from companion.motion.inertial import VelocityFix
from companion.reflex.monitor import advance, start_monitor

CONFIG = EstimateConfig()
CONTACT_US = 10_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)


def fixes(seed, seconds=1.0, acceleration=2.0, delay_s=0.02, bias=0.05, noise=0.032, every_us=32_000):
    """Velocities north at constant acceleration, 2 m/s at the contact, errors as the simulated estimate has them."""
    rng = random.Random(seed)
    error = rng.gauss(0.0, noise)
    keep = math.exp(-every_us * 1e-6 / 0.3)
    for t_us in range(CONTACT_US - round(seconds * 1e6), CONTACT_US - 5_000, every_us):
        t = (t_us - CONTACT_US) * 1e-6
        error = keep * error + rng.gauss(0.0, noise * math.sqrt(1 - keep**2))
        velocity = 2.0 + acceleration * (t - delay_s) + error
        measured = acceleration + bias
        yield VelocityFix(t_us, (velocity, 0.0, 0.0), (measured * t, 0.0, 0.0), (measured, 0.0, 0.0))


def velocity_at(heard):
    return approach.velocity_at(list(heard), CONTACT_US, (0.0, 0.0, 0.0), CONFIG)


def test_v_c_is_right_to_a_few_centimetres_whatever_the_delay_the_bias_and_the_errors_that_last():
    errors = [velocity_at(fixes(seed, delay_s=0.02 * (seed % 2)))[0][0] - 2.0 for seed in range(60)]
    assert math.sqrt(sum(e * e for e in errors) / len(errors)) < 0.04


def test_the_stated_error_of_v_c_is_true():
    pairs = [velocity_at(fixes(seed)) for seed in range(60)]
    rms = math.sqrt(sum((v[0] - 2.0) ** 2 for v, _ in pairs) / len(pairs))
    assert 0.4 < rms / pairs[0][1] < 1.5


def test_an_accelerometer_that_contradicts_the_velocities_is_not_listened_to():
    wrong = [VelocityFix(f.time_boot_us, f.velocity_ned_m_s, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) for f in fixes(1)]
    assert velocity_at(wrong) is None
    assert velocity_at([]) is None


@pytest.mark.parametrize("late_us", [0, 100_000, 290_000])
def test_a_hit_that_is_told_late_has_the_velocity_from_before_it(late_us):
    # Given velocities that go on after the contact, 3 m/s off
    heard = list(fixes(2))
    for t_us in range(CONTACT_US + 20_000, CONTACT_US + late_us, 20_000):
        heard.append(VelocityFix(t_us, (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    velocity, _ = velocity_at(heard)
    assert velocity[0] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    ("jumps", "velocity_m_s"),
    [
        ({}, 2.0),
        # A jump that the estimator counts itself, and a contact: what was before is no measure any more
        ({"reset_counter": 1}, 5.0),
        ({"touched_us": CONTACT_US - 900_000}, 5.0),
    ],
)
def test_v_c_is_found_from_velocities_that_belong_together(jumps, velocity_m_s):
    # Given a vehicle at 2 m/s that tells 5 m/s in its last 0.8 s
    estimator = ImpactEstimator(CONFIG)
    estimator.update(Attitude(0, LEVEL, (0.0, 0.0, 0.0)))
    for t_us in range(CONTACT_US - 4_000_000, CONTACT_US, 4_000):
        estimator.update(ImuSample(t_us, (0.0, 0.0, -9.80665), (0.0, 0.0, 0.0)))
        estimator.update(Attitude(t_us, LEVEL, (0.0, 0.0, 0.0)))
        is_last = t_us > CONTACT_US - 800_000
        if t_us == jumps.get("touched_us"):
            estimator.contact_ended_boot_us = t_us
        if t_us % 20_000 == 0:
            told, count = (5.0, jumps.get("reset_counter", 0)) if is_last and jumps else (2.0, 0)
            estimator.update(Odometry(t_us, (0.0, 0.0, 0.0), (told, 0.0, 0.0), count))
    found = estimator._velocity(CONTACT_US)
    assert found is not None
    assert found[0][0] == pytest.approx(velocity_m_s, abs=0.05)


GUARDS = GuardsConfig(travel_m=0.03)
WINDOW_S = 0.004
FREE = (0.0, 0.0, -9.80665)


def turned_by(vector_rad):
    """Rotation matrix."""
    angle = np.linalg.norm(vector_rad) + 1e-12
    x, y, z = vector_rad / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def quaternion(r):
    """Of a rotation by less than half a turn."""
    w = 0.5 * math.sqrt(1.0 + np.trace(r))
    return w, (r[2, 1] - r[1, 2]) / (4 * w), (r[0, 2] - r[2, 0]) / (4 * w), (r[1, 0] - r[0, 1]) / (4 * w)


def touch(slant_deg, friction, tangent_m_s, every_s=0.004, lean_deg=0.0, pole_m=None, first_s=0.003):
    """A touch of the front right guard at 1.5 m/s, followed in fine steps by hand: what the wire tells, and the normal.

    The vehicle is level, nose north; the obstacle, a wall or a pole of a radius, is turned and leans by the angles
    given. `first_s` after the touch comes the first sample.
    """
    slant, lean = math.radians(slant_deg), math.radians(lean_deg)
    n0 = np.array([-math.cos(lean) * math.cos(slant), -math.cos(lean) * math.sin(slant), math.sin(lean)])
    middle = GUARDS.centre_m * np.array([1.0, 1.0, 0.0]) / math.sqrt(2.0)

    def rim(n, r):
        against = -(r.T @ n)
        level = np.array([against[0], against[1], 0.0])
        place = middle + GUARDS.radius_m * level / np.linalg.norm(level)
        place[2] += 0.5 * GUARDS.height_m * max(-1.0, min(1.0, against[2] / 0.1))
        return r @ place, np.linalg.norm(level)

    r, x, v, w = np.eye(3), np.zeros(3), np.array([1.5, tangent_m_s, 0.0]), np.zeros(3)
    start, gyration2, step_s = rim(n0, r)[0], np.square(GUARDS.gyration_frd_m), 1e-4
    axis = start - (pole_m or 0.0) * n0
    force, rates, fits = [np.array(FREE)] * 400, [np.zeros(3)] * 400, [(1.0, 0.0, 0.0, 0.0)] * 400
    for _ in range(round(0.03 / step_s)):
        n = n0
        if pole_m is not None:
            n = (x + r @ middle - axis) * (1.0, 1.0, 0.0)
            n = n / np.linalg.norm(n)
        place, share = rim(n, r)
        depth = -(x + place - (axis + (pole_m or 0.0) * n)) @ n
        sliding = v + np.cross(r @ w, place)
        inward = -sliding @ n
        size = max(0.0, (GUARDS.stiffness_per_s2 * depth + GUARDS.damping_per_s * inward) / share**2) * (depth >= 0.0)
        sliding = sliding + inward * n
        contact = size * (n - friction * sliding / max(np.linalg.norm(sliding), 0.02))
        body = r.T @ contact + FREE
        v = v + step_s * (r @ body + (0.0, 0.0, 9.80665))
        x = x + step_s * v
        w = w + step_s * (r.T @ np.cross(place, contact)) / gyration2
        r = r @ turned_by(step_s * w)
        force.append(body)
        rates.append(w)
        fits.append(quaternion(r))
    samples, attitudes = [], [Attitude(CONTACT_US - 20_000, LEVEL)]
    window = round(WINDOW_S / step_s)
    for number in range(-1, 6):
        at = 400 + round((first_s + number * every_s) / step_s)
        if at > len(force):
            break
        told_us = CONTACT_US + round(1e6 * number * every_s)
        mean = np.mean(force[at - window : at], axis=0)
        samples.append(ImuSample(told_us, tuple(mean), tuple(np.mean(rates[at - window : at], axis=0))))
        attitudes.append(Attitude(told_us, fits[at - 1]))
    return Touch(FREE, samples, attitudes), tuple(n0)


def off_deg(normal, true):
    return math.degrees(math.acos(min(1.0, sum(a * b for a, b in zip(normal, true, strict=True)))))


def found(heard, tangent_m_s):
    return normal_of(heard, (1.5, tangent_m_s, 0.0), GUARDS, 0.005)


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.2, 0.3])
@pytest.mark.parametrize(("slant_deg", "tangent_m_s"), [(15.0, 0.0), (25.0, 0.0), (15.0, 0.5), (25.0, -0.5)])
def test_the_normal_is_found_through_any_friction(friction, slant_deg, tangent_m_s):
    """Also where friction leans the push straight back, as a head-on hit would be without any."""
    heard, true = touch(slant_deg, friction, tangent_m_s)
    normal = found(heard, tangent_m_s)
    assert off_deg(normal, true) < 6.0
    assert math.hypot(*normal) == pytest.approx(1.0)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_two_samples_of_a_slow_stream_are_enough(friction):
    heard, true = touch(25.0, friction, 0.4, every_s=0.020)
    assert off_deg(found(heard, 0.4), true) < 10.0


@pytest.mark.parametrize("pole_m", [0.03, 0.15])
def test_a_pole_is_found_though_its_normal_turns_as_the_guard_rolls(pole_m):
    heard, true = touch(30.0, 0.3, 0.6, pole_m=pole_m)
    assert off_deg(found(heard, 0.6), true) < 10.0


def test_it_is_the_turning_that_tells_friction_from_a_slant():
    """The same pushes on a vehicle that nothing turned were not on that guard's rim."""
    heard, true = touch(25.0, 0.3, 0.0)
    unturned = [replace(sample, angular_velocity_frd_rad_s=(0.0, 0.0, 0.0)) for sample in heard.samples]
    level = [replace(told, attitude_wxyz=LEVEL) for told in heard.attitudes]
    with_turning = off_deg(found(heard, 0.0), true)
    without = off_deg(found(Touch(FREE, unturned, level), 0.0), true)
    assert with_turning < 6.0 < without


@pytest.mark.parametrize("lean_deg", [-30.0, 30.0])
def test_a_leaning_walls_normal_is_found_though_friction_holds_what_slides_along_it(lean_deg):
    heard, true = touch(15.0, 0.3, 0.0, lean_deg=lean_deg)
    assert off_deg(found(heard, 0.0), true) < 10.0


@pytest.mark.parametrize("slant_deg", [15.0, 25.0])
def test_where_the_first_sample_may_have_clipped_the_turning_still_tells_the_normal(slant_deg):
    """Given forces cut to half of what they were, when that is known to be possible, then they are not relied on."""
    heard, true = touch(slant_deg, 0.3, 0.0)
    forces = [sample.specific_force_frd_m_s2 for sample in heard.samples]
    halved = [(0.5 * x, y, z) for x, y, z in forces]
    cut = [replace(s, specific_force_frd_m_s2=f) for s, f in zip(heard.samples, halved, strict=True)]
    assert off_deg(found(replace(heard, samples=cut, is_clipped=True), 0.0), true) < 10.0
    relied_on = found(replace(heard, samples=cut), 0.0)
    assert relied_on is None or off_deg(relied_on, true) > 10.0


def test_a_push_that_may_have_clipped_is_looked_at_until_then_or_whole_where_it_did_at_once():
    later = pushed([(-20.0, True), (-60.0, True), (-20.0, True)])
    at_once = pushed([(-60.0, True), (-60.0, True), (-20.0, True)])
    assert (len(later.touch.samples), later.touch.is_clipped) == (1, False)
    assert (len(at_once.touch.samples), at_once.touch.is_clipped) == (3, True)


def test_what_was_not_pushed_or_seen_has_no_normal():
    heard, _ = touch(15.0, 0.3, 0.0)
    assert normal_of(Touch(FREE), (0.0, 0.0, 0.0), GUARDS, 0.005) is None
    assert found(Touch(FREE, heard.samples[:1], heard.attitudes), 0.0) is None
    assert found(Touch(FREE, heard.samples, []), 0.0) is None


def test_a_search_goes_on_by_pieces_of_bounded_work_and_comes_to_the_same(monkeypatch):
    """Each message of a flight has to be answered before the next setpoint is due."""
    followed = []

    def counted(trials, *arguments, misfits=guards.weighted_residuals):
        followed[-1] += len(trials)
        return misfits(trials, *arguments)

    monkeypatch.setattr(guards, "weighted_residuals", counted)
    heard, _ = touch(25.0, 0.3, 0.4, every_s=0.020)
    search = normal.begin_search(heard, (1.5, 0.4, 0.0), GUARDS, 0.005)
    while not search.is_over:
        followed.append(0)
        before, search = search, normal.advance_search(search)
    assert max(followed) <= normal.HYPOTHESES_A_PIECE
    assert len(followed) <= 10
    assert normal.advance_search(before).normal_ned == search.normal_ned
    assert normal.advance_search(search) is search
    followed.append(0)
    assert found(heard, 0.4) == search.normal_ned


def imu(t_us, contact, yaw_rate=0.0):
    return ImuSample(t_us, (contact, 0.0, -9.81), (0.0, 0.0, yaw_rate))


def pushed(pushes, every_us=4_000, yaw_rate=0.0):
    contact = ContactForce((0.0, 0.0, -9.81), LEVEL, 5_000, 156.9, 1_000_000)
    for number, (force, loud) in enumerate(pushes, start=1):
        contact.add(imu(1_000_000 + number * every_us, force, yaw_rate), loud)
    return contact


def test_the_impulse_is_the_sum_of_the_loud_samples_and_of_what_lies_between_them():
    contact = pushed([(-20.0, True), (-40.0, True), (-1.0, False), (-10.0, True), (-5.0, False)])
    assert contact.impulse_ned_m_s == pytest.approx((-0.284, 0.0, 0.0))
    assert contact.peak_m_s2 == pytest.approx(40.0)


def test_of_a_few_clipped_axes_the_normal_lies_half_way_to_where_the_vehicle_came_from():
    # Given a push of two axes at the sensor's end, 45 degrees off the way that a vehicle came
    contact = ContactForce((0.0, 0.0, -9.81), LEVEL, 5_000, 156.9, 1_000_000)
    for number in (1, 2):
        contact.add(
            replace(imu(1_000_000 + 4_000 * number, 0.0), specific_force_frd_m_s2=(-156.9, -156.9, -9.81)), True
        )
    off_rad = math.radians(22.5)
    assert final_normal(contact, None, (2.0, 0.0, 0.0)) == pytest.approx((-math.cos(off_rad), -math.sin(off_rad), 0.0))
    # Of one that hardly moved, and of a push that was measured, it is the push's own
    own = (-math.sqrt(0.5), -math.sqrt(0.5), 0.0)
    assert final_normal(contact, None, (0.1, 0.0, 0.0)) == pytest.approx(own)
    measured = pushed([(-10.0, True), (-25.0, True), (-30.0, True), (-22.0, True), (-8.0, True)])
    assert final_normal(measured, own, (2.0, 0.0, 0.0)) == own


def test_a_push_that_rises_and_falls_within_the_range_was_measured_whole():
    assert not pushed([(-10.0, True), (-25.0, True), (-30.0, True), (-22.0, True), (-8.0, True)]).is_lower_bound


def test_the_first_window_tells_when_the_contact_began():
    """A quarter of the second window's mean: three quarters of it (5 ms) were still free."""
    contact = pushed([(-10.0, True), (-40.0, True)])
    assert contact.begun_boot_us == 1_004_000 - 1_250


def test_a_vehicle_that_turns_in_the_contact_is_followed():
    contact = pushed([(-20.0, True)] * 25, yaw_rate=math.radians(90.0) / 0.096)
    north, east, _ = contact.impulse_ned_m_s
    assert math.degrees(math.atan2(-east, -north)) == pytest.approx(45.0, abs=2.0)


@pytest.mark.parametrize(
    ("pushes", "every_us"),
    [
        ([(-60.0, True)] * 5, 4_000),
        ([(-20.0, True)] * 2, 4_000),
        ([(-20.0, True)] * 5, 20_000),
        ([(-3.0, True), (-30.0, True), (-4.0, True), (-3.0, True)], 4_000),
        ([(-19.0, True), (23.6, True), (-13.1, True), (-4.7, True)], 4_000),
    ],
    ids=["may have clipped", "too short to tell", "gaps", "over in one window", "guards that clatter"],
)
def test_what_may_have_been_more_is_a_lower_bound(pushes, every_us):
    assert pushed(pushes, every_us).is_lower_bound


def test_the_watch_tells_t_c_v_c_normal_impulse_and_class_and_takes_clipping_counts_to_heart():
    """North at 1.5 m/s, a wall stops the vehicle with 30 m/s^2 for 50 ms; the sensor says a second later it clipped."""
    monitor = start_monitor(CompanionConfig(detector="fused"), 0)
    situation = Situation(armed=True, landed_state=LandedState.IN_AIR, height_m=3.0)
    finished, hit_us = [], 3_002_000
    for t in range(4_000, 4_400_000, 4_000):
        inside = max(0, min(t, hit_us + 50_000) - max(t - 4_000, hit_us)) / 4_000
        speed = 1.5 - 30.0 * 1e-6 * max(0, min(t - hit_us, 50_000))
        samples: list[Sample] = [ImuSample(t, (-30.0 * inside, 0.0, -9.81), (0.0, 0.0, 0.0))]
        if t % 32_000 == 0:
            samples.append(Odometry(t, (0.0, 0.0, -3.0), (speed, 0.0, 0.0), 0))
            samples.append(LocalPosition(t, (1.5 * t * 1e-6, 0.0, -3.0), (speed, 0.0, 0.0)))
            samples.append(Attitude(t, LEVEL))
        if t % 1_000_000 == 0:
            samples.append(Vibration(t, 0.0, 0.0, (0 if t < hit_us else 9, 0, 0)))
        finished += advance(monitor, samples, situation, t).finished
    (final,) = finished
    assert final.kind is ImpactKind.WALL
    assert abs(final.time_boot_us - hit_us) < 2_000
    assert final.velocity_ned_m_s == pytest.approx((1.5, 0.0, 0.0), abs=0.03)
    assert final.position_ned_m[0] == pytest.approx(1.5 * hit_us * 1e-6, abs=0.03)
    assert final.normal_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.15)
    assert final.impulse_m_s == pytest.approx(1.5, abs=0.05)
    assert (final.is_lower_bound, monitor.estimate.is_lower_bound) == (False, True)
    assert not final.may_be_clipped
