"""Hits alone: judged as whole flights are, the same bits twice, and honest bounds."""

import pytest

from bench.cases.hits import HitCase
from bench.fly.guarded import draw_flown
from bench.rows.tables import at_most, at_most_of_groups
from bench.studies.hits import work_out_flown
from tests.bench.test_recoveries import flown as flown_whole

pytestmark = pytest.mark.slow


def judged(case: HitCase) -> dict:
    return {name: value for name, value in work_out_flown(case).items() if name != "processor_s"}


@pytest.mark.parametrize(
    ("airframe", "speed_m_s"), [("foldable", 1.0), ("foldable", 4.0), ("rigid", 2.0), ("rigid", 3.0)]
)
def test_a_hit_alone_is_judged_as_the_hit_of_a_whole_mission(airframe, speed_m_s):
    # Given a square hit on a wall after a take-off and a way to it
    outcome, whole = flown_whole(airframe, speed_m_s)
    # When the same hit is flown alone
    alone = judged(HitCase(1, airframe, "wall", speed_m_s, imu_hz=250))
    # Then both were found, neither came back or fell, and both came to rest: by the truth before the estimate shows it
    assert outcome == "completed" and alone["found"] and not alone["false"]
    assert alone["closing_m_s"] == pytest.approx(speed_m_s, abs=0.15)
    assert alone["again"] == whole["returned"] == 0
    assert max(alone["lost_m"], whole["lost_m"]) < 0.05
    # As far from its setpoint as a vehicle that has settled may be (SettledConfig.distance_m).
    assert whole["past_m"] < 0.1
    assert 0.3 * whole["settled_s"] < alone["rest_s"] < whole["settled_s"]


def test_the_same_seed_gives_the_same_hit():
    case = draw_flown(20, True)
    assert judged(case) == judged(case)
    assert judged(case) != judged(draw_flown(28, True))


def test_a_touch_too_soft_for_the_detector_is_missed():
    touched = judged(HitCase(5, "rigid", "wall", 0.1, imu_hz=50))
    assert not touched["found"] and touched["rest_s"] is None


@pytest.mark.parametrize(("events", "of", "share"), [(0, 300, 0.00994), (1, 300, 0.01572), (0, 0, 1.0), (5, 5, 1.0)])
def test_the_bound_is_clopper_and_pearsons_and_hits_by_one_vehicle_count_as_fewer(events, of, share):
    assert at_most(events, of) == pytest.approx(share, abs=1e-5)
    together = [(4, 4), (0, 4), (0, 4), (0, 4)] * 25
    assert at_most_of_groups(together) == pytest.approx(at_most(25, 100), abs=3e-3)
    assert at_most_of_groups([(0, 50)] * 300) == at_most(0, 300)
    assert at_most_of_groups([]) == at_most_of_groups([(3, 3)]) == 1.0
