"""Kills around a hit: what is drawn, what a flight shows, and the table."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from bench.studies.kills import cases, killed, work_out
from tests.bench.random_missions.made_up import hit


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


@pytest.mark.parametrize(("killed_at_s", "again_m_s"), [(9.9, 0.8), (10.05, 0.8), (10.4, 0.6), (10.9, 0.0)])
def test_a_second_contact_is_the_hardest_after_the_kill_the_touch_itself_apart(killed_at_s, again_m_s):
    # Given a touch at 2 m/s and two contacts after it, and a kill before or between them
    touch = hit(10.0, 2.0)
    truth = SimpleNamespace(
        hits=[touch, hit(10.2, 0.8), hit(10.6, 0.6)], series=lambda: {"velocity_ned_m_s": [(0.0, 0.3, 0.4)]}
    )
    on_the_ground = SimpleNamespace(body=[0.0, 0.0, -0.08])
    vehicle = SimpleNamespace(time_boot_us=killed_at_s * 1e6, truth=truth, state=on_the_ground)
    programs = [SimpleNamespace(last_words=list)]
    flight: Any = SimpleNamespace(vehicle=vehicle, programs=programs, step=list, step_alone=lambda told: told)
    kill = killed(flight, touch)
    assert kill["again_m_s"] == pytest.approx(again_m_s) and kill["ground_m_s"] == pytest.approx(0.5)


@pytest.mark.slow
def test_a_guard_in_between_that_dies_in_a_recovery_leaves_the_vehicle_to_px4s_failsafe_which_lands():
    case = replace(cases(10, first_seed=1, of_guard=True)[0], kills_s=(0.5,))
    flight = work_out(case)
    (kill,) = flight["kills"]
    assert kill["again_m_s"] == 0.0 and kill["mode"] == "POSCTL"
    assert kill["ground_m_s"] == pytest.approx(0.7, abs=0.2), "MPC_LAND_SPEED"
