"""Hits alone: the same verdicts as whole flights, the same bits twice, and honest bounds."""

import pytest

from bench.detectors.hits import HitCase
from bench.hits.flight import FlownHit, draw_flown, flown_campaign, work_out_flown
from bench.hits_report.cells import Flown, at_most, cells, lead, seeds
from bench.recoveries.hits import RecoveryCase, work_out

pytestmark = pytest.mark.slow


def judged(case: FlownHit) -> dict:
    """Without what differs from one run to the next."""
    return {key: value for key, value in work_out_flown(case).items() if key != "cost"}


@pytest.mark.parametrize(
    ("airframe", "speed_m_s"), [("foldable", 1.0), ("foldable", 4.0), ("rigid", 2.0), ("rigid", 3.0)]
)
def test_a_hit_alone_is_judged_as_the_hit_of_a_whole_mission(airframe, speed_m_s):
    # Given a square hit on a wall after a take-off and a way to it
    whole = work_out(RecoveryCase("adaptive", airframe, 0, speed_m_s, 1))
    # When the same hit is flown alone
    alone = judged(FlownHit(HitCase("flown", 1, airframe, "wall", speed_m_s, ()), 250))
    # Then both were found, neither came back or fell, and both came to rest: by the truth before the estimate shows it
    assert whole["outcome"] == "completed" and alone["found"] and not alone["false"]
    assert alone["closing_m_s"] == pytest.approx(speed_m_s, abs=0.15)
    assert alone["again"] == whole["returned"] == 0
    assert max(alone["lost_m"], whole["lost_m"]) < 0.05
    assert 0.5 * whole["settled_s"] < alone["rest_s"] < whole["settled_s"]


def test_the_same_seed_gives_the_same_hit():
    case = draw_flown(20, True)
    assert judged(case) == judged(case)
    assert judged(case) != judged(draw_flown(28, True))


def test_a_hit_on_a_vehicle_that_shakes_too_much_is_missed():
    shaken = judged(FlownHit(HitCase("flown", 5, "foldable", "wall", 1.0, (), vibration_m_s2=40.0), 250))
    assert shaken["touched"] and not shaken["found"] and shaken["rest_s"] is None


def test_every_airframe_approach_and_rate_is_drawn_equally_often():
    drawn = flown_campaign(16, 1, False).cases
    assert len({(case.hit.airframe, case.imu_hz, case.hit.approach) for case in drawn}) == 16


@pytest.mark.parametrize(("events", "of", "share"), [(0, 300, 0.00994), (1, 300, 0.01572), (0, 0, 1.0), (5, 5, 1.0)])
def test_the_bound_is_clopper_and_pearsons(events, of, share):
    assert at_most(events, of) == pytest.approx(share, abs=1e-5)


def test_a_cell_with_a_miss_too_many_is_named():
    hit = {
        "touched": True,
        "found": True,
        "false": 0,
        "closing_m_s": 1.5,
        "tilt_deg": 5.0,
        "lost_m": 0.0,
        "rest_s": 1.0,
    }
    hit |= {"again": 0, "seconds": 3.0}
    cases = flown_campaign(1600, 1, False).cases
    results = {number: dict(hit) for number in range(1600)}
    missed = next(number for number, case in enumerate(cases) if (case.hit.airframe, case.imu_hz) == ("rigid", 50))
    several = [n for n, case in enumerate(cases) if (case.hit.airframe, case.imu_hz) == ("rigid", 50)][:3]
    for number in several:
        results[number] |= {"found": False, "rest_s": None}
    text = "\n".join([*lead(Flown(cases, results)), *cells(Flown(cases, results)), *seeds(Flown(cases, results))])
    assert "| rigid, 50 Hz | 1 to 2 | 400 | 3 |" in text
    open_cells = text.partition("false alarms:\n")[2]
    assert "rigid, 50 Hz, 1 to 2 m/s" in open_cells and "foldable, 50 Hz, 1 to 2 m/s" not in open_cells
    assert f"Missed at 0.5 m/s and more: 3, by seed {cases[missed].hit.seed}" in text
