"""Single hits through the whole wire with both laws, by what the simulator knows."""

import pytest

from bench.cases.walls import into_a_wall
from bench.fly.lockstep import fly
from bench.rows.contacts import contacts_of
from bench.rows.recovered import recoveries
from companion.mission.model import Mission
from rebound_cli.inputs import with_guards
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene

pytestmark = pytest.mark.slow


def flown(airframe, speed_m_s, slant_deg=0, law="adaptive"):
    """The outcome of a flight into a wall, which holds after its hit, and that recovery's figures."""
    kind = load_built_in(airframe)
    data = into_a_wall("recovery", speed_m_s, slant_deg, 2.5)
    data |= {"on_collision": {"then": "hold", "hold_s": 2.0}, "recovery": {"law": law}}
    mission = Mission.model_validate(with_guards(data, kind))
    flight = fly(mission, Scene.model_validate({**data["sim"], "airframe": airframe, "seed": 1}), kind)
    return flight.report.outcome, recoveries(flight, contacts_of(flight))[0]


def test_adaptive_settles_a_fifth_sooner_without_running_past():
    paper, adaptive = (flown("foldable", 2.0, law=law) for law in ("paper", "adaptive"))
    assert (paper[0], adaptive[0]) == ("completed", "completed")
    paper, adaptive = paper[1], adaptive[1]
    assert adaptive["settled_s"] < 0.8 * paper["settled_s"]
    assert adaptive["past_m"] < 0.05 and adaptive["again"] == 0


def test_a_vehicle_that_the_hit_spins_comes_to_rest_though_lower_and_further_on():
    """Rigid, 5 m/s, 30 degrees: 16 rad/s of yaw, which turn the tilt aside of what is asked for, and 9 m/s that the
    estimate has missed, of which it takes a part for a tilt of 20 degrees meanwhile.
    """
    outcome, flight = flown("rigid", 5.0, 30)
    assert outcome == "completed"
    assert flight["lost_m"] < 0.3
    assert flight["past_m"] < 0.8
