"""Parameters: PX4's names, what counts and when, and what they change."""

import math

import pytest

from sim_vehicle.parameters.store import Parameters, definitions


def test_names_are_px4s_and_their_defaults_lie_within_their_ranges():
    rows = definitions()
    assert len(rows) > 100
    assert list(rows) == sorted(rows)
    for row in rows.values():
        assert len(row.name) <= 16 and row.name == row.name.upper()
        assert isinstance(row.default, int) is row.is_whole
        assert row.limited(row.default) == row.default, row.name


@pytest.mark.parametrize(("value", "counts"), [(100.0, 8.0), (-1.0, 0.5), (math.nan, 3.0), (math.inf, 8.0)])
def test_what_is_out_of_range_is_stored_but_does_not_count(value, counts):
    parameters = Parameters()
    parameters.set("MPC_Z_VEL_MAX_UP", value)
    assert str(parameters.stored("MPC_Z_VEL_MAX_UP")) == str(value)
    assert parameters["MPC_Z_VEL_MAX_UP"] == counts


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_a_value_without_end_does_not_count_where_px4_states_no_range(value):
    parameters = Parameters()
    for name in ("RTL_RETURN_ALT", "BAT1_V_CHARGED"):
        parameters.set(name, value)
        assert math.isfinite(parameters[name])
