"""What a vehicle says that cannot be: places, attitudes and forces that contradict each other cost a twitch at most."""

import math
import random
from dataclasses import replace

import pytest

from bench.fly.packets import made
from companion import messages
from companion.messages import LandedState, LocalPosition, Odometry, PositionSetpoint, PositionTarget
from companion.motion.history import MotionHistory
from companion.motion.resets import Resets
from companion.motion.strapdown import VelocityFix
from companion.reflex.belief.motion_estimator import MotionEstimator
from companion.reflex.config import EstimateConfig
from companion.reflex.detection.confirmation import Hypothesis
from companion.reflex.surface import Contact
from tests.companion.fake_vehicle import LOITER, flying_in, hovering
from tests.companion.hostile import attacked

STILL = (0.0, 0.0, 0.0)


def told(at_ms, north_m, counter=0, speed_m_s=0.0):
    return Odometry(at_ms * 1000, (north_m, 0.0, -1.0), (speed_m_s, 0.0, 0.0), counter)


def place(at_ms, north_m):
    return LocalPosition(at_ms * 1000, (north_m, 0.0, -1.0), STILL)


# --- the estimator's resets


def followed(resets, samples):
    return [resets.follow(sample, 5.0) for sample in samples]


def test_a_reset_moves_what_is_heard_and_what_is_sent_and_the_vehicle_stays_where_it_is():
    resets = Resets()
    # Given a vehicle that flies north at 1 m/s
    followed(resets, [told(0, 0.0, 0, 1.0), place(0, 0.0)])
    # When its estimate jumps by 3 m within 20 ms, and says so twice
    followed(resets, [told(20, 3.02, 1, 1.0)])
    assert resets.shift_ned_m == STILL, "one message may be forged"
    heard = followed(resets, [told(40, 3.04, 1, 1.0), place(40, 3.04)])
    # Then the flight goes on where it was, and the setpoint is sent where the vehicle now thinks that this is
    assert [sample.position_ned_m[0] for sample in heard] == pytest.approx([0.04, 0.04])
    assert resets.sent(PositionSetpoint(0, (1.0, 0.0, -1.0), None)).position_ned_m == pytest.approx((4.0, 0.0, -1.0))
    (echo,) = followed(resets, [PositionTarget((4.0, 0.0, -1.0))])
    assert echo.position_ned_m == pytest.approx((1.0, 0.0, -1.0)), "a setpoint comes back as it was meant"
    # And a counter that comes back is the frame of then
    followed(resets, [told(60, 0.06, 0, 1.0), told(80, 0.08, 0, 1.0)])
    assert resets.shift_ned_m == STILL
    # After a silence nobody knows how far the vehicle has flown
    followed(resets, [told(2_080, 4.0, 1, 3.0), told(2_100, 4.1, 1, 3.0)])
    assert resets.has_shifted and resets.shift_ned_m[0] == pytest.approx(3.0), "the counter of before has its own"
    followed(resets, [told(4_100, 9.0, 2, 3.0), told(4_120, 9.1, 2, 3.0)])
    assert resets.shift_ned_m[0] == pytest.approx(3.0)


def test_a_place_that_jumps_is_believed_only_where_the_vehicle_has_counted_a_reset():
    resets = Resets()
    followed(resets, [told(0, 0.0), place(0, 0.0)])
    (jumped,) = followed(resets, [place(20, 50.0)])
    assert isinstance(jumped, messages.Refused) and "no reset" in jumped.reason
    assert followed(resets, [place(40, 0.1)]) == [place(40, 0.1)]
    followed(resets, [told(60, 50.0, 1), told(70, 50.0, 1)])
    assert followed(resets, [place(80, 50.0)]) == [place(80, 50.0)]
    # A vehicle that counts none has to be believed
    assert [followed(Resets(), [place(at_ms, north_m)]) for at_ms, north_m in ((0, 0.0), (20, 50.0))][1][0] == place(
        20, 50.0
    )


@pytest.mark.parametrize("is_wrong", [False, True])
def test_a_reset_moves_no_vehicle_and_is_told_but_where_it_puts_right_what_a_hit_left(is_wrong):
    # Given a vehicle that hovers, and counts its resets
    f = hovering()

    def counted(resets, later_us=0):
        places = dict(zip(("x", "y", "z"), f.vehicle.position, strict=True)) | {"frame_id": 1, "child_frame_id": 1}
        stamp = {"time_usec": f.vehicle.time_us + later_us, "reset_counter": resets, "q": [1.0, 0.0, 0.0, 0.0]}
        return made("ODOMETRY", places | stamp)

    attacked(f, [counted(0)])
    before_m = list(f.vehicle.position)
    # When its estimate jumps by 3 m north
    f.vehicle.position[0] += 3.0
    if is_wrong:
        contact = Contact((0.0, 0.0, -2.0), (2.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
        after = MotionEstimator(contact, f.vehicle.time_us, contact.rebound(0.45), EstimateConfig())
        f.companion.core.reflex.monitor.estimator.followed = [after]
    attacked(f, [counted(1, 1000), counted(1, 2000)])
    f.run_for(1.0)
    if is_wrong:
        assert f.vehicle.setpoints[-1][1].x == pytest.approx(before_m[0], abs=0.02), "it had been elsewhere"
        return
    # Then it stays where it is, which it now calls 3 m further north, and the mission goes on
    assert f.vehicle.position == pytest.approx([before_m[0] + 3.0, *before_m[1:]], abs=0.02)
    assert f.vehicle.setpoints[-1][1].x == pytest.approx(before_m[0] + 3.0, abs=0.02)
    told = f.event("estimate").data
    assert (told["jump_m"], told["shift_ned_m"][0]) == pytest.approx((3.0, 3.0), abs=0.01)
    assert f.companion.status().position_ned_m == pytest.approx(before_m, abs=0.02) and f.state == "mission"


# --- hits that nothing else shows


@pytest.mark.parametrize(
    ("force_m_s2", "noise_m_s", "changed_m_s", "across_m_s", "is_none"),
    [
        (14.0, 0.0, 0.0, 0.0, True),
        (14.0, 0.0, 0.04, 0.0, False),
        (14.0, 0.1, 0.0, 0.0, False),
        (60.0, 0.1, 0.0, 0.0, True),
        # A stuck axis shows no force along itself
        (14.0, 0.0, 0.0, 0.4, True),
        (14.0, 0.0, 0.0, 0.6, False),
    ],
)
def test_velocities_reject_one_sample_whose_impulse_they_would_show(
    force_m_s2, noise_m_s, changed_m_s, across_m_s, is_none
):
    # 14 m/s^2 for 5 ms are 0.07 m/s; beside a noise of 0.1 m/s velocities say nothing of that, and of 0.3 m/s they do
    noise = random.Random(1)
    # Given a vehicle that hovers, every 10 ms its velocity less the accelerometer's sum, which has all of the claim's
    less_m_s, heard = changed_m_s - 0.004 * force_m_s2, []
    for at_ms in range(800, 1160, 10):
        north_m_s = noise.gauss(0.0, noise_m_s) + (less_m_s if at_ms > 1000 else 0.0)
        east_m_s = 0.001 * (at_ms % 3) + (across_m_s if at_ms > 1000 else 0.0)
        heard.append(VelocityFix(at_ms * 1000, (north_m_s, east_m_s, 0.0), STILL))
    hypothesis = Hypothesis(
        1_000_000, 996_000, 0.005 * force_m_s2, (1.0, 0.0, 0.0), force_m_s2, 996_000, later_boot_us=1_004_000
    )
    assert hypothesis.is_rejected(heard, MotionHistory(), 0.03) is is_none
    # And while an earlier hit is corrected, which may hide as much, they reject nothing
    assert not replace(hypothesis, left_m_s=0.0025 * force_m_s2).is_rejected(heard, MotionHistory(), 0.03)


@pytest.mark.parametrize(("shown_m_s", "is_none"), [(0.3, False), (0.2, True)])
def test_a_jump_of_the_velocity_that_fades_is_a_hit_where_one_velocity_shows_half_of_it(shown_m_s, is_none):
    """A ceiling met at 2 m/s between the samples at 50 Hz: the sum drifts while the vehicle turns."""
    was = [VelocityFix(at_ms * 1000, STILL, STILL) for at_ms in range(800, 950, 30)]
    came = [
        VelocityFix(at_ms * 1000, (0.0, 0.0, shown_m_s - 0.0015 * (at_ms - 1040)), STILL)
        for at_ms in range(1040, 1150, 33)
    ]
    hit = Hypothesis(1_000_000, 930_000, 0.51, (0.0, 0.0, 1.0))
    assert hit.is_rejected([*was, *came], MotionHistory(), 0.03) is is_none


@pytest.mark.parametrize(("height_m", "said_s", "answers"), [(1.5, 1, True), (0.3, 1, False), (0.3, 0, True)])
def test_a_landing_counts_once_it_lasts_and_where_the_height_does_not_speak_against_it(height_m, said_s, answers):
    # Given a vehicle on its way to its goal, when it is said for so long to stand on the ground
    f = flying_in("mission")
    f.run_for(0.5)
    for _ in range(10):
        f.vehicle.position[2] = -height_m
        attacked(f, [made("EXTENDED_SYS_STATE", {"landed_state": LandedState.ON_GROUND})])
    f.companion.core.flight.vehicle.landed_us -= round(1e6 * said_s)
    # Then a hit of that moment is answered up in the air, and not below the height from which hits count
    f.vehicle.push_m_s2 = (-60.0, 0.0)
    f.step()
    assert (f.state == "recovering") is answers


# --- silence


def place_in(sent):
    return sent.x, sent.y, sent.z


@pytest.mark.parametrize("state", ["takeoff", "mission", "returning"])
def test_who_does_not_hear_where_the_vehicle_is_flies_no_further_and_catches_up_with_nothing(state):
    f = flying_in(state)
    f.run_until(lambda: f.vehicle.armed)
    f.run_for(0.7)
    # When positions stop coming for longer than the detector may be without a sample
    f.vehicle.no_positions = True
    f.run_for(0.4)
    held = [sent for _, sent in f.setpoints_since(f.now_us - 100_000)]
    places = {place_in(sent) for sent in held}
    # Then the setpoint stands still, asks for no velocity, and goes on from there
    assert len(held) > 3 and len(places) == 1 and all(sent.type_mask & 0x038 == 0x038 for sent in held)
    f.vehicle.no_positions = False
    f.run_for(0.1)
    _, sent = f.setpoints_since(f.now_us - 30_000)[-1]
    assert math.dist(place_in(sent), places.pop()) < 2.0 * 0.1 + 0.01


def test_a_clock_that_jumps_is_no_silence_of_the_positions():
    f = flying_in("mission")
    f.run_for(0.7)
    # When the clock jumps, as of a suspended computer, and an IMU sample is the first that comes
    f.run_until(lambda: f.vehicle.ticks % 5 == 1)
    f.now_us += 5_000_000
    f.run_for(0.5)
    # Then the flight goes on
    assert f.state == "mission" and f.setpoints_since(f.now_us - 50_000)
    # And positions that do not come end it, as ever
    f.vehicle.no_positions = True
    f.run_to("aborted", 1.2)
    f.run_to_end(2.0)
    assert f.vehicle.mode == LOITER
    assert "no LOCAL_POSITION_NED for 1.0 s, though the link is alive" in " ".join(f.texts())


@pytest.mark.slow
def test_a_recovery_that_is_struck_again_and_again_ends_when_one_hit_s_would():
    f = flying_in("recovering")
    began_us = f.now_us
    timeout_us = 10_000_000
    while f.state == "recovering" and f.now_us - began_us < 2 * timeout_us:
        f.vehicle.push_m_s2 = (-60.0, 0.0)
        f.run_for(0.3)
    assert len(f.report.collisions) > 10
    assert f.now_us - began_us == pytest.approx(timeout_us, abs=1_000_000)
    assert f.state == "holding"


@pytest.mark.parametrize("late_ms", [200, 1000])
def test_a_position_that_comes_late_or_from_before_a_reboot_is_no_fault(late_ms):
    """By as much as a mean's time or a second, for which what is learnt of drag and wind would be divided by zero."""
    f = flying_in("returning")
    for _ in range(200):
        motion = zip(("x", "y", "z", "vx", "vy", "vz"), [*f.vehicle.position, *f.vehicle.velocity], strict=True)
        late = {"time_boot_ms": f.vehicle.time_us // 1000 - late_ms, **dict(motion)}
        attacked(f, [made("LOCAL_POSITION_NED", late)])
    assert "fault" not in f.kinds(), f.texts()
