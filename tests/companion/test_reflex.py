"""The reflex by its door alone: samples in, hits out, and nobody's mission."""

import pytest

from companion.messages import Attitude, AttitudeTarget, ImuSample, LandedState, LocalPosition, Odometry, Sample
from companion.mission.config import CompanionConfig
from companion.motion.config import GRAVITY_M_S2
from companion.motion.strapdown import LEVEL
from companion.motion.vector import ZERO
from companion.reflex.config import RecoveryConfig
from companion.reflex.reflex import start_reflex
from tests.companion.watching import IN_FLIGHT

TICK_US = 4_000


class FreeRoom:
    """Nothing else is known, and there is no fence."""

    def surfaces(self, contact):
        return ()

    def inside(self, contact_ned_m, goal_ned_m):
        return goal_ned_m


@pytest.mark.parametrize("force_m_s2", [0.0, 40.0])
def test_a_velocity_and_a_force_of_one_time_confirm_each_other_in_whichever_order_they_come(force_m_s2):
    # Given a vehicle that flies north, whose estimator takes a jump back, as of a hit that clipping hides whole
    config, rejected = CompanionConfig(), []
    reflex = start_reflex(config, RecoveryConfig(), config.settled, 0)
    for us in range(TICK_US, 3_600_000, TICK_US):
        samples: list[Sample] = [ImuSample(us, (-force_m_s2 if us == 3_000_000 else 0.0, 0.0, -GRAVITY_M_S2), ZERO)]
        if us % (5 * TICK_US) == 0:
            place = (2e-6 * us, 0.0, -2.0)
            velocity = (1.0 if us == 3_000_000 else 2.0, 0.0, 1e-3 * (us // (5 * TICK_US) % 2))
            told = [Odometry(us, place, velocity, 0), Attitude(us, LEVEL, ZERO), LocalPosition(us, place, velocity)]
            samples = [*told, AttitudeTarget(us, 0.6), *samples]
        for estimate in reflex.step(samples, IN_FLIGHT, us).collisions:
            assert us == 3_000_000, "told with the first sample that shows it"
            reflex.begin(estimate, FreeRoom(), us)
        if reflex.recovery is not None:
            shown = [reflex.recovery.take(sample) for sample in samples if isinstance(sample, LocalPosition)]
            rejected += [progress for progress in shown if progress.is_rejected]
        reflex.follow(samples, 2.0, LandedState.IN_AIR)
    # Then the jump alone was none, and with a force of the same time it was a hit
    assert len(reflex.hits) == 1
    assert bool(rejected) is (force_m_s2 == 0.0)
    # And one that is taken back leaves nothing
    assert not reflex.monitor.estimator.validity.is_valid
    reflex.take_back()
    assert reflex.hits == [] and reflex.monitor.estimator.validity.is_valid
