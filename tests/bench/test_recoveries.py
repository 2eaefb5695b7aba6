"""Single hits through the whole wire with both laws, by what the simulator knows."""

import pytest

from bench.cases.missions import MissionCase
from bench.fly.campaign import Results
from bench.rows.judge import work_out_mission
from bench.rows.tables import MET, MISSED
from bench.studies.laws import RecoveryCase, law_bars, law_table, laws_campaign, rows, work_out

pytestmark = pytest.mark.slow


def test_adaptive_settles_a_fifth_sooner_without_running_past_and_clear_of_the_wall():
    """This cell; bench/notes/results.md has the median of all."""
    paper, adaptive = (work_out(RecoveryCase(law, "foldable", 0, 2.0, 1)) for law in ("paper", "adaptive"))
    assert (paper["outcome"], adaptive["outcome"]) == ("completed", "completed")
    assert adaptive["settled_s"] < 0.8 * paper["settled_s"]
    assert adaptive["past_m"] < 0.05 and adaptive["recontacts"] == 0
    assert adaptive["clear_m"] > 0.3


def test_a_vehicle_that_the_hit_spins_comes_to_rest_though_lower_and_further_on():
    """Rigid, 5 m/s, 30 degrees: 16 rad/s of yaw, which turn the tilt aside of what is asked for, and 9 m/s that the
    estimate has missed, of which it takes a part for a tilt of 20 degrees meanwhile.
    """
    flight = work_out(RecoveryCase("adaptive", "rigid", 30, 5.0, 1))
    assert flight["outcome"] == "completed"
    assert flight["lost_m"] < 0.2
    assert flight["past_m"] < 0.8


@pytest.mark.parametrize(("airframe", "speed_m_s"), [("rigid", 2.0), ("foldable", 4.0)])
def test_a_clipped_hit_that_the_vehicle_has_not_seen_whole_leads_neither_into_the_wall_nor_past_the_goal(
    airframe, speed_m_s
):
    """A real PX4 after such a hit (bench/notes/px4.md) says "into the wall", and is right a second later."""
    flight = work_out(RecoveryCase("adaptive", airframe, 0, speed_m_s, 1))
    assert (flight["outcome"], flight["recontacts"], flight["returned"]) == ("completed", 0, 0)
    assert flight["past_m"] < 0.05
    assert flight["clear_m"] > 0.3
    # At 4 m/s it is thrown up by 0.6 m/s, which shows when the estimate begins to be put right, after 0.16 s
    assert flight["risen_m"] < 0.25 and flight["lost_m"] < 0.1


def test_a_motion_that_is_at_first_too_much_for_the_hit_is_looked_at_again():
    """The estimate swings past the rebound by 0.1 m/s, for one sample: no setpoint was found anew."""
    hit = work_out_mission(MissionCase(seed=15591, airframe="rigid", feed_forward=True))["hits"][0]
    assert 2.3 < hit["speed_m_s"] < 2.6
    assert hit["past_m"] < 0.15
    assert hit["settled_s"] < 4.0


def test_the_table_has_a_line_for_each_kind_of_hit():
    campaign = laws_campaign(1)
    figures = {
        "settled_s": 2.0,
        "past_m": 0.01,
        "clear_m": 0.5,
        "lost_m": 0.02,
        "risen_m": 0.0,
        "recontacts": 0,
        "returned": 0,
    }
    settled_s = {"paper": 4.0, "adaptive": 1.0}
    results = {n: {**figures, "settled_s": settled_s[case.law]} for n, case in enumerate(campaign.cases)}
    text = law_table(rows(campaign, Results(results, {})))
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines()]
    both = "0.01 → 0.01", "0.50 → 0.50", "0.02 → 0.02", "0.00 → 0.00", "0 (0) → 0 (0)"
    assert ["foldable, 0°", "1 m/s", "4.00 s (0 not) → 1.00 s (0 not)", *both] in lines and len(lines) == 2 + 20


def laws(**adaptive):
    """Hits with both laws: `adaptive` as asked."""
    campaign = laws_campaign(1)
    touches = {"recontacts": 0, "returned": 0}
    paper = {"settled_s": 3.0, "past_m": 0.0, "clear_m": 1.0, "lost_m": 0.02, "risen_m": 0.0, **touches}
    good = {**paper, "settled_s": 1.5, "clear_m": 0.6, **adaptive}
    results = {n: dict(paper if case.law == "paper" else good) for n, case in enumerate(campaign.cases)}
    return law_bars(rows(campaign, Results(results, {})))


@pytest.mark.parametrize(
    ("adaptive", "word"),
    [
        ({"settled_s": 2.4}, "settles sooner"),
        ({"past_m": 0.06}, "overshoot, worst"),
        ({"recontacts": 1}, "wall again"),
        ({"clear_m": 0.25}, "clear by"),
        ({"lost_m": 0.11}, "height lost"),
        ({"risen_m": 0.06}, "height gained"),
    ],
)
def test_each_figure_of_the_laws_has_its_bar(adaptive, word):
    assert {bar.verdict for bar in laws() if bar.is_met is not None} == {MET}
    assert next(bar.verdict for bar in laws(**adaptive) if word in bar.what) == MISSED
