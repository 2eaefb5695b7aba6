"""Walls found by touch and flown round, by the whole companion and the simulated vehicle: no place is touched twice."""

import pytest

from companion.memory.surroundings import LEAST_FREE_M
from tests.missions.detours import Wall, fly_detour

pytestmark = [pytest.mark.flight, pytest.mark.slow]

REACH_M = 0.2


@pytest.mark.parametrize(
    ("wall", "speed_m_s", "airframe", "seed"),
    [
        (Wall(5.0, 0.21, 19.0), 2.0, "foldable", 4),
        (Wall(3.0, -0.5, -20.0), 1.0, "rigid", 2),
    ],
)
def test_a_slanted_wall_is_passed_and_no_remembered_part_of_it_touched(wall, speed_m_s, airframe, seed):
    detour = fly_detour(wall, speed_m_s, airframe, seed)
    assert detour.report.outcome == "completed" and detour.report.unreachable == ()
    assert detour.nearest_to_goal_m < 0.5
    assert 2 <= len(detour.report.collisions) <= 7
    assert min(detour.off_known_m) > REACH_M + LEAST_FREE_M
