"""Numbers in a page: read back as they were, to half of what they are kept by; and which rows of a long flight stay."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rebound_cli.report.content import kept_rows, packed
from tests.rebound_cli.report.opened import unpacked


@given(st.lists(st.floats(-300.0, 300.0), min_size=1, max_size=50))
def test_numbers_come_back_to_half_the_resolution(values):
    again = unpacked(packed(np.array(values), 0.01))
    assert np.abs(again - values).max() <= 0.005 + 1e-9


@pytest.mark.parametrize(("most", "kind"), [(60.0, "i2"), (6000.0, "i4")])
def test_a_column_takes_two_bytes_a_number_where_it_fits_and_four_elsewhere(most, kind):
    column = packed(np.linspace(-most, most, 7), 0.01)
    assert column["kind"] == kind
    assert np.allclose(unpacked(column), np.linspace(-most, most, 7), atol=0.005)


def test_what_is_not_finite_is_none_and_harms_no_neighbour():
    again = unpacked(packed(np.array([1.0, np.nan, -np.inf, 2.0]), 0.001))
    assert np.isnan(again).tolist() == [False, True, True, False] and np.allclose(again[[0, 3]], [1.0, 2.0])
    # Nor is a number beyond four bytes another one; and a column of nothing is one
    assert np.isnan(unpacked(packed(np.array([0.0, 1e9]), 1e-5))).any()
    assert len(unpacked(packed(np.array([]), 0.1))) == 0


def test_of_a_long_flight_all_round_a_hit_stay_and_the_loudest_of_everything_else():
    # Given 1000 s at 10 Hz, a hit at 500 s, and one loud sample far from it
    seconds, loud = np.linspace(0.0, 999.9, 10_000), np.full(10_000, np.nan)
    loud[1234] = 0.9
    rows = kept_rows(seconds, loud, np.array([500.0]), 1.0, 500)
    assert set(np.flatnonzero(np.abs(seconds - 500.0) <= 1.0)) <= set(rows)
    assert 1234 in rows and len(rows) == 500
    assert (np.diff(rows) > 0).all()
    # and nothing of the flight is left out for long, of a short one nothing at all
    assert np.diff(seconds[rows]).max() < 5.0
    assert len(kept_rows(seconds, loud, np.array([]), 1.0, 10_000)) == 10_000
