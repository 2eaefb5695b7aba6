"""Hits alone: the same verdicts as whole flights, the same bits twice, and honest bounds."""

import itertools
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from bench.cases.hits import HitCase
from bench.fly.campaign import Results
from bench.fly.guarded import (
    APART_S,
    FREE_S,
    HITS_AN_APPROACH,
    LED_PATIENCE_S,
    MOMENTS,
    Approach,
    FlownHit,
    Verdict,
    begun,
    draw_flown,
    followed,
)
from bench.fly.moments import Moment
from bench.rows.hits import work_out_flown
from bench.rows.tables import at_most, at_most_of_groups
from bench.studies.hits import hit_rows, hits_campaign, lead, parts
from companion.companion import StepResult
from sim_vehicle.scene import Scene
from tests.bench.test_recoveries import flown as flown_whole

pytestmark = pytest.mark.slow

BY_CELL = "By airframe, rate and speed"


def judged(case: FlownHit) -> dict:
    (row,) = work_out_flown(case)["hits"]
    return row


@pytest.mark.parametrize(
    ("airframe", "speed_m_s"), [("foldable", 1.0), ("foldable", 4.0), ("rigid", 2.0), ("rigid", 3.0)]
)
def test_a_hit_alone_is_judged_as_the_hit_of_a_whole_mission(airframe, speed_m_s):
    # Given a square hit on a wall after a take-off and a way to it
    outcome, whole = flown_whole(airframe, speed_m_s)
    # When the same hit is flown alone
    alone = judged(FlownHit(HitCase("flown", 1, airframe, "wall", speed_m_s, ()), 250))
    # Then both were found, neither came back or fell, and both came to rest: by the truth before the estimate shows it
    assert outcome == "completed" and alone["found"] and not alone["false"]
    assert alone["closing_m_s"] == pytest.approx(speed_m_s, abs=0.15)
    assert alone["again"] == whole["returned"] == 0
    assert max(alone["lost_m"], whole["lost_m"]) < 0.05
    assert 0.3 * whole["settled_s"] < alone["rest_s"] < whole["settled_s"]


def test_the_same_seed_gives_the_same_hit():
    case = draw_flown(20, True)
    assert judged(case) == judged(case)
    assert judged(case) != judged(draw_flown(28, True))


def test_a_hit_on_a_vehicle_that_shakes_too_much_is_missed():
    shaken = judged(FlownHit(HitCase("flown", 5, "foldable", "wall", 1.0, (), vibration_m_s2=40.0), 250))
    assert not shaken["found"] and shaken["rest_s"] is None


def test_what_is_rewound_flies_on_to_the_same_bytes():
    # Given a flight that goes on, with a hit and a recovery in it
    approach = Approach(draw_flown(21, True))
    approach.fly_until(FREE_S)
    before = approach.moment()
    flight = approach.flight

    def flown() -> tuple[list[list[StepResult]], bytes]:
        flight.vehicle.meet(approach.scene("leaning wall", 0.02, np.random.default_rng(5)))
        return [flight.step() for _ in range(200)], flight.vehicle.state.body.tobytes()

    first = flown()
    assert flight.guard.collisions()
    # When it is put back, then there was no hit, and it comes again as it came
    before.rewind()
    assert not flight.guard.collisions() and not flight.vehicle.truth.hits
    assert flown() == first


def test_an_object_that_cannot_be_put_back_is_refused():
    with pytest.raises(TypeError, match="count cannot be put back"):
        Moment({"numbers": itertools.count()})


def test_everything_that_changes_is_put_back():
    @dataclass(slots=True)
    class Slotted:
        rows: np.ndarray

    whole, draws = np.arange(6.0), np.random.default_rng(1)
    things: dict[str, Any] = {
        "view": Slotted(whole[2:4]),
        "queue": deque([1, 2], maxlen=3),
        "set": {1},
        "list": [whole, (draws,)],
    }
    moment = Moment(things)
    first = draws.random()
    whole += 1.0
    things["view"].rows, things["new"] = None, 1
    things["queue"].append(7)
    things["set"].clear()
    del things["list"][0]
    moment.rewind()
    assert list(things) == ["view", "queue", "set", "list"] and things["list"][0] is whole
    assert things["view"].rows.tolist() == [2.0, 3.0] and things["view"].rows.base is whole
    assert list(things["queue"]) == [1, 2] and things["set"] == {1} and draws.random() == first


def test_a_touch_at_an_interval_s_very_end_is_no_false_alarm():
    # Given a hit that begins with the last step of an interval, which the sensor's sample of it shows
    verdict = Verdict(1_432_000.0, 1.0, 1_432_000)
    # Then it was found at once, and a microsecond earlier it would have been a false alarm
    assert verdict.late_us == 0.0 and not verdict.is_early
    assert Verdict(verdict.touched_us, 1.0, 1_431_999).is_early


def from_the_beginning(case: FlownHit, scene: Scene) -> Verdict:
    """The same hit by a vehicle that has the obstacle before it all the time: nothing is put there or rewound."""
    return followed(begun(case, scene, keeps_path=True), FREE_S + MOMENTS * APART_S + LED_PATIENCE_S)


@pytest.mark.parametrize("seed", [40, 45, 51])
def test_verdicts_are_those_of_hits_that_are_flown_from_the_beginning(seed):
    case = draw_flown(seed, True)
    flown = list(Approach(case).hits())
    assert len(flown) == HITS_AN_APPROACH
    for scene, verdict in flown[seed % 16 :: 16]:
        assert from_the_beginning(case, scene) == verdict


def test_a_miss_is_a_miss_from_the_beginning_too():
    # Given a vehicle that shakes so much that it misses hits
    case = FlownHit(HitCase("flown", 5, "foldable", "wall", 1.0, (), vibration_m_s2=3.0), 50)
    flown = list(Approach(case).hits())
    missed = [(scene, verdict) for scene, verdict in flown if verdict.touched_us and verdict.late_us is None]
    assert 0 < len(missed) < len(flown)
    for scene, verdict in missed[:2]:
        assert from_the_beginning(case, scene) == verdict


@pytest.mark.parametrize(("events", "of", "share"), [(0, 300, 0.00994), (1, 300, 0.01572), (0, 0, 1.0), (5, 5, 1.0)])
def test_the_bound_is_clopper_and_pearsons_and_hits_by_one_vehicle_count_as_fewer(events, of, share):
    assert at_most(events, of) == pytest.approx(share, abs=1e-5)
    together = [(4, 4), (0, 4), (0, 4), (0, 4)] * 25
    assert at_most_of_groups(together) == pytest.approx(at_most(25, 100), abs=3e-3)
    assert at_most_of_groups([(0, 50)] * 300) == at_most(0, 300)
    assert at_most_of_groups([]) == at_most_of_groups([(3, 3)]) == 1.0


def test_a_page_counts_misses_by_cell_and_names_them():
    # Given eight approaches with 48 hits each, of which one was missed
    campaign = hits_campaign(8 * HITS_AN_APPROACH, 1, False, verdicts=True)
    one = {"watched_s": 1.5, "false": False, "processor_s": 0.1}
    found = {"closing_m_s": 1.5, "latency_ms": 8.0, "found": True, "approach": "wall"}
    results = {at: {**one, "hits": [{"number": n, **found} for n in range(HITS_AN_APPROACH)]} for at in range(8)}
    results[2]["hits"][7] |= {"latency_ms": None, "found": False}
    results[3] |= {"false": True}
    rows = hit_rows(campaign, Results(results, {}))
    page, case = parts(rows), campaign.cases[2]
    # Then the cell says so, is named as one that shows nothing, and the hit can be looked for
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in page[BY_CELL].splitlines()]
    name = f"{case.hit.airframe}, {case.imu_hz} Hz, [1.0, 2.0) m/s"
    assert [name, "96", "2", "1", "1.042"] in [row[:5] for row in cells]
    assert name in page[BY_CELL].partition("Not shown")[2]
    assert "384 hits, 1 missed; 1 false alarms in 0.00 h" in lead(rows, list(results.values()))
    assert f"{case.hit.seed}/7/" in page["Missed at 0.5 m/s and more"]
