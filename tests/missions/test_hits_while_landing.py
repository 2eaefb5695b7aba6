"""Hits on the way down: answered like any other, and then the landing goes on."""

import pytest

from companion.mission.model import Mission
from rebound_cli.inputs import SimulatedWorld, with_guards
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.simulation.lockstep import fly_mission_lockstep
from sim_vehicle.airframe import load_built_in
from sim_vehicle.scene import Scene

pytestmark = pytest.mark.flight


def flown(folder, obstacles, **more):
    data = {
        "name": "down",
        "items": [{"takeoff": {"height_m": 2.5}}, {"land": {}}],
        "fence": {"radius_m": 10, "max_height_m": 5},
        "sim": obstacles,
        **more,
    }
    world = SimulatedWorld(Scene.model_validate({**obstacles, "seed": 1}), load_built_in("foldable"))
    mission = Mission.model_validate(with_guards(data, world.airframe))
    recorder = FlightRecorder(folder)
    flight, _ = fly_mission_lockstep(mission, world, recorder, Interrupts())
    recorder.close()
    return flight


# A wall that comes from the north while the vehicle goes down, and stops where it touched it.
GATE = {
    "walls": [
        {
            "name": "gate",
            "point_ned_m": [2.0, 0, -2],
            "normal_ned": [-1, 0, 0],
            "width_m": 6,
            "height_m": 6,
            "motion": {"velocity_ned_m_s": [-1.2, 0, 0], "from_s": 9.5, "until_s": 11.1},
        }
    ]
}


@pytest.mark.parametrize("policy", ["hold", pytest.param("return", marks=pytest.mark.slow)])
def test_a_hit_in_the_descent_is_recovered_from_and_the_landing_goes_on(tmp_path, policy):
    # Given a landing from 2.5 m, when a gate strikes the vehicle on its way down
    flight = flown(tmp_path, GATE, on_collision={"then": policy})
    hit, collision = flight.truth.hits[0], flight.report.collisions[0]
    assert 0.8 < -hit.contact_position_ned_m[2] < 2.4, "on the way down"
    # Then it is answered at once, away from the gate, and the vehicle lands clear of it, whatever the policy
    assert collision.sample_time_boot_us - hit.contact_at_boot_us < 50_000
    assert collision.recovery_setpoint_ned_m[0] < hit.contact_position_ned_m[0] - 0.3
    assert flight.report.outcome == "completed", flight.report.reason
    assert flight.truth.series["position_ned_m"][-1][0] < hit.contact_position_ned_m[0] - 0.25
