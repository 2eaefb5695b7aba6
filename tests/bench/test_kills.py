"""Kills around a hit: what is drawn, what a flight shows, and the table."""

from dataclasses import replace

import pytest

from bench.studies.kills import cases, work_out


@pytest.mark.slow
def test_a_brake_that_nobody_ends_does_not_lead_back_to_the_wall():
    """Held, the brake of 0.6 s after the hit led the vehicle back at 1 m/s."""
    case = cases(50, first_seed=1)[4]
    flight = work_out(replace(case, kills_s=(-0.1, 0.6, 0.87)))
    assert flight["touch_m_s"] > 2.5 and flight["again_m_s"] == 0.0
    unanswered, *braked = flight["kills"]
    for kill, at_s in zip(braked, (0.6, 0.87), strict=True):
        assert abs(kill["kill_s"] - at_s) < 0.01
        assert kill["again_m_s"] == 0.0
        assert kill["ground_m_s"] < 1.5
    # Killed before the touch nobody answers it: what is held then leads back to the wall.
    assert abs(unanswered["kill_s"] + 0.1) < 0.01
    assert 0.3 < unanswered["again_m_s"] < 0.5 * flight["touch_m_s"]


@pytest.mark.slow
def test_a_guard_in_between_that_dies_in_a_recovery_leaves_the_vehicle_to_px4s_failsafe_which_lands():
    case = replace(cases(10, first_seed=1, of_guard=True)[0], kills_s=(0.5,))
    flight = work_out(case)
    (kill,) = flight["kills"]
    assert kill["again_m_s"] == 0.0 and kill["mode"] == "POSCTL"
    assert kill["ground_m_s"] == pytest.approx(0.7, abs=0.2), "MPC_LAND_SPEED"
