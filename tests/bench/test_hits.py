"""The bound on how often something happens, of single hits and of hits by one vehicle."""

import pytest

from bench.rows.tables import at_most, at_most_of_groups

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("events", "of", "share"), [(0, 300, 0.00994), (1, 300, 0.01572), (0, 0, 1.0), (5, 5, 1.0)])
def test_the_bound_is_clopper_and_pearsons_and_hits_by_one_vehicle_count_as_fewer(events, of, share):
    assert at_most(events, of) == pytest.approx(share, abs=1e-5)
    together = [(4, 4), (0, 4), (0, 4), (0, 4)] * 25
    assert at_most_of_groups(together) == pytest.approx(at_most(25, 100), abs=3e-3)
    assert at_most_of_groups([(0, 50)] * 300) == at_most(0, 300)
    assert at_most_of_groups([]) == at_most_of_groups([(3, 3)]) == 1.0
