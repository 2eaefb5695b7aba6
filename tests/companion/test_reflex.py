"""The reflex by its door alone: a vehicle of a few equations, a wall, and nobody's mission."""

import math

import pytest

from companion.messages import Attitude, AttitudeTarget, ImuSample, LandedState, LocalPosition, Odometry, Sample
from companion.mission.config import CompanionConfig
from companion.motion.config import GRAVITY_M_S2
from companion.motion.rotation import body_to_ned, ned_to_body
from companion.motion.strapdown import LEVEL
from companion.motion.vector import ZERO, limited, minus, plus
from companion.reflex.attitude_law import held_off, tilted
from companion.reflex.config import BRAKES_M_S2, MOST_HELD_S, NOTICED_S, RecoveryConfig
from companion.reflex.detector import Situation
from companion.reflex.reflex import Reflex, start_reflex

FULL_M_S2, TICK_US = 16.0, 4_000
IN_FLIGHT = Situation(armed=True, landed_state=LandedState.IN_AIR, height_m=2.0)
WALL_NORTH_M, CONTACT_S, RESTITUTION = 6.0, 0.02, 0.5
DOWN = (0.0, 0.0, 1.0)


class FreeRoom:
    """Nothing else is known, and there is no fence."""

    def surfaces(self, contact):
        return ()

    def inside(self, contact_ned_m, goal_ned_m):
        return goal_ned_m


class Air:
    """A vehicle that flies north at 2 m/s, and whatever the reflex asks for; its attitude lags as a loop of 12 rad/s.

    From the touch on a wall pushes it for CONTACT_S, so that it leaves at RESTITUTION times its speed.
    """

    def __init__(self) -> None:
        config = CompanionConfig()
        self.reflex: Reflex = start_reflex(config, RecoveryConfig(), config.settled, 0)
        self.reflex.loss_s = 0.3
        self.place, self.velocity, self.up, self.turns = (0.0, 0.0, -2.0), (2.0, 0.0, 0.0), (0.0, 0.0, -1.0), ZERO
        self.asked, self.thrust = tilted(self.up, 0.0), GRAVITY_M_S2 / FULL_M_S2
        self.now_us = 0
        self.touched_us: int | None = None
        self.told_us: int | None = None
        self.is_alone = False
        self.nearest_m = -math.inf  # since the rebound: the wall is at 0

    def step(self) -> None:
        self.now_us += TICK_US
        force = plus(ZERO, self.thrust * FULL_M_S2, self.up)
        if self.touched_us is None and self.place[0] >= WALL_NORTH_M:
            self.touched_us = self.now_us
        if self.touched_us is not None and self.now_us < self.touched_us + 1e6 * CONTACT_S:
            force = plus(force, (1.0 + RESTITUTION) * 2.0 / CONTACT_S, (-1.0, 0.0, 0.0))
        pulls = plus(plus(ZERO, 144.0, minus(body_to_ned(self.asked, (0.0, 0.0, -1.0)), self.up)), -24.0, self.turns)
        self.turns = plus(self.turns, 1e-6 * TICK_US, pulls)
        self.up = plus(self.up, 1e-6 * TICK_US, self.turns)
        self.velocity = plus(self.velocity, 1e-6 * TICK_US, plus(force, GRAVITY_M_S2, DOWN))
        self.place = plus(self.place, 1e-6 * TICK_US, self.velocity)
        if self.velocity[0] < 0.0 or self.is_alone:
            self.nearest_m = max(self.nearest_m, self.place[0] - WALL_NORTH_M)
        if not self.is_alone:
            self._react(self._samples(force))

    def _samples(self, force):
        us, wxyz = self.now_us, tilted(self.up, 0.0)
        (a, b, c), (x, y, z) = self.up, self.turns
        rates = ned_to_body(wxyz, (b * z - c * y, c * x - a * z, a * y - b * x))
        samples = [ImuSample(us, ned_to_body(wxyz, force), rates)]
        if us % (5 * TICK_US) == 0:
            velocity = plus(self.velocity, 1e-3 * (us // (5 * TICK_US) % 2), DOWN)
            samples += [Attitude(us, wxyz, rates), AttitudeTarget(us, self.thrust)]
            samples += [LocalPosition(us, self.place, velocity), Odometry(us, self.place, velocity, 0)]
        return samples

    def _react(self, samples) -> None:
        reflex = self.reflex
        for estimate in reflex.step(samples, IN_FLIGHT, self.now_us).collisions:
            self.told_us = self.told_us or self.now_us
            reflex.begin(estimate, FreeRoom(), self.now_us)
        recovery = reflex.recovery
        if recovery is not None:
            for sample in samples:
                if isinstance(sample, LocalPosition):
                    recovery.take(sample)
        reflex.follow(samples, 2.0, LandedState.IN_AIR)
        if recovery is not None and recovery.leans:
            acceleration, lean = reflex.lean(0.0)
            # As the envelope bounds it.
            acceleration = held_off(acceleration, lean.belief, lean.surfaces, lean.held_s)
            setpoint = lean.setpoint(self.now_us, acceleration)
            self.asked, self.thrust = setpoint.attitude_wxyz, setpoint.thrust_fraction

    def fly(self, seconds: float) -> "Air":
        for _ in range(round(1e6 * seconds / TICK_US)):
            self.step()
        return self

    def fly_alone(self, seconds: float) -> "Air":
        """Nobody hears it: it flies what was asked for last until it notices that, and then brakes with 3 m/s^2."""
        self.is_alone, until_us = True, self.now_us + 1e6 * (MOST_HELD_S + NOTICED_S)
        for _ in range(round(1e6 * seconds / TICK_US)):
            if self.now_us >= until_us:
                brakes = limited(plus(ZERO, -10.0, (self.velocity[0], self.velocity[1], 0.0)), BRAKES_M_S2)
                self.asked = tilted(plus(brakes, -GRAVITY_M_S2, DOWN), 0.0)
            self.step()
        return self


def test_a_hit_is_told_with_its_first_sample_and_flown_to_rest_clear_of_the_wall():
    air = Air().fly(3.0 + 0.1)
    while air.reflex.recovery.leans:
        assert air.now_us < 4.2e6, "not at rest within 1.2 s"
        air.step()
    assert air.told_us == air.touched_us
    (hit,) = air.reflex.hits
    assert hit.contact.velocity_ned_m_s == pytest.approx((2.0, 0.0, 0.0), abs=0.01)
    assert hit.normal.direction_ned == pytest.approx((-1.0, 0.0, 0.0), abs=0.01)
    # Then it is handed over to a place: at rest, and guards clear of the wall
    assert math.hypot(*air.velocity) < 0.3
    assert 0.3 < WALL_NORTH_M - air.place[0] < 0.8
    assert air.place[2] == pytest.approx(-2.0, abs=0.05)


@pytest.mark.parametrize("after_s", [0.2, 0.3, 0.4, 0.5, 0.6, 0.7])
def test_an_attitude_that_is_held_and_then_turned_back_from_does_not_lead_to_the_wall_again(after_s):
    # Given a companion that dies while the vehicle brakes its rebound, leaning towards the wall
    air = Air().fly(3.0 + after_s)
    left_m = air.nearest_m
    air.fly_alone(2.0)
    assert air.nearest_m <= max(left_m, -0.02), "before it touches again it is at rest"
    # Its loops of 12 rad/s take two time constants to turn the thrust
    _, lean = air.reflex.lean(0.0)
    assert lean.held_s == pytest.approx(MOST_HELD_S + NOTICED_S + 2.0 / 12.0, abs=0.03)


@pytest.mark.parametrize("force_m_s2", [0.0, 40.0])
def test_a_velocity_and_a_force_of_one_time_confirm_each_other_in_whichever_order_they_come(force_m_s2):
    # Given a vehicle whose estimator takes a jump back, as of a hit that clipping hides whole
    air, rejected = Air(), []
    for us in range(TICK_US, 3_600_000, TICK_US):
        samples: list[Sample] = [ImuSample(us, (-force_m_s2 if us == 3_000_000 else 0.0, 0.0, -GRAVITY_M_S2), ZERO)]
        if us % (5 * TICK_US) == 0:
            place = (2e-6 * us, 0.0, -2.0)
            velocity = (1.0 if us == 3_000_000 else 2.0, 0.0, 1e-3 * (us // (5 * TICK_US) % 2))
            told = [Odometry(us, place, velocity, 0), Attitude(us, LEVEL, ZERO), LocalPosition(us, place, velocity)]
            samples = [*told, AttitudeTarget(us, air.thrust), *samples]
        air.now_us = us
        for estimate in air.reflex.step(samples, IN_FLIGHT, us).collisions:
            air.reflex.begin(estimate, FreeRoom(), us)
        if air.reflex.recovery is not None:
            shown = [air.reflex.recovery.take(sample) for sample in samples if isinstance(sample, LocalPosition)]
            rejected += [progress for progress in shown if progress.is_rejected]
        air.reflex.follow(samples, 2.0, LandedState.IN_AIR)
    # Then the jump alone was none, and with a force of the same time it was a hit
    assert len(air.reflex.hits) == 1
    assert bool(rejected) is (force_m_s2 == 0.0)


def test_a_hit_that_is_taken_back_leaves_nothing():
    air = Air().fly(3.02)
    assert len(air.reflex.hits) == 1 and not air.reflex.monitor.estimator.validity.is_valid
    air.reflex.take_back()
    assert air.reflex.hits == [] and air.reflex.monitor.estimator.validity.is_valid
