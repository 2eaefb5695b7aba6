"""Airframes with a list of rotors: what is refused, what the mixer makes of them, and that they stand and hover."""

import math
import random
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from sim_vehicle.airframe import Airframe, load_built_in, with_base
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.hil.parameters import as_airframe_file, px4_parameters
from sim_vehicle.physics.layout import allocation, arms_of
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene
from tests.simulated import simulated

# Vehicles, each flown in a thirtieth of a second.
DRAWN = 40
SIDES = ("cw", "cw", "ccw", "ccw")


def ring(count: int, radius_m: float, stretch: float = 1.0) -> list[dict[str, Any]]:
    """Evenly around the centre, turning one way and the other; half a step off the nose."""
    angles = [2.0 * math.pi * (number + 0.5) / count for number in range(count)]
    return [
        {"place_frd_m": (radius_m * math.cos(angle), stretch * radius_m * math.sin(angle)), "direction": turns}
        for angle, turns in zip(angles, ("ccw", "cw") * (count // 2), strict=True)
    ]


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ({"rotors": ring(2, 0.145)}, "give 4, 6 or 8"),
        ({"rotors": [*ring(4, 0.145)[:3], {"place_frd_m": (0, 0.145), "direction": "cw"}]}, "from the centre of mass"),
        ({"rotors": [rotor | {"direction": "cw"} for rotor in ring(4, 0.145)]}, "turns about itself"),
        ({"rotors": ring(6, 0.3)}, r"0\.300 m from the centre, geometry\.hub_radius_m and arm_length_m say 0\.145 m"),
        ({"rotors": ring(8, 0.145)}, r"guards would overlap; make geometry\.guard_radius_m 0\.055 or less"),
        # Left ccw, right cw: what rolls also yaws
        ({"rotors": [rotor | {"direction": SIDES[at]} for at, rotor in enumerate(ring(4, 0.145))]}, "one by one"),
    ],
)  # fmt: skip
def test_rotors_that_cannot_fly_are_refused(part: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        Airframe.model_validate(with_base({"based_on": "foldable", **part}))


@pytest.mark.parametrize("name", ["foldable", "hexa", "octo", "racer"])
def test_the_mixer_makes_the_moments_that_are_asked_and_leaves_the_sum_of_thrusts(name: str) -> None:
    airframe = load_built_in(name)
    mix, roll_lever_m, yaw_lever_m = allocation(airframe)
    thrusts_n = mix / [roll_lever_m, roll_lever_m, yaw_lever_m]
    directions, radii_m, signs = arms_of(airframe)
    places_m = radii_m[:, None] * directions
    made = np.array([-places_m[:, 1], places_m[:, 0], airframe.motors.moment_per_thrust_m * signs, np.ones(len(signs))])
    assert made @ thrusts_n == pytest.approx(np.vstack([np.eye(3), np.zeros(3)]), abs=1e-3)


def test_px4_gets_each_rotor_in_the_order_of_the_file() -> None:
    airframe = load_built_in("octo")
    found = {parameter.name: parameter.value for parameter in px4_parameters(airframe)}
    assert found["CA_ROTOR_COUNT"] == 8
    for number, rotor in enumerate(airframe.rotors):
        place_m = found[f"CA_ROTOR{number}_PX"], found[f"CA_ROTOR{number}_PY"]
        assert place_m == pytest.approx(rotor.place_frd_m)
        assert (found[f"CA_ROTOR{number}_KM"] > 0.0) == (rotor.direction == "ccw")
    assert "# @type Octorotor x" in as_airframe_file(airframe)


@pytest.mark.parametrize(("name", "kind"), [("hexa", "hexarotor"), ("octo", "octorotor"), ("racer", "quadrotor")])
def test_each_meets_a_wall_recovers_and_lands(name: str, kind: str) -> None:
    flight = simulated("wall", f"sim.airframe={name}")
    flight.run_to_end()
    assert kind in flight.event("connected").text
    assert len(flight.hits) == 1 and flight.hits[0].closing_speed_m_s == pytest.approx(2.0, abs=0.2)
    assert flight.event("recovered").text.startswith("recovered: settled") and flight.kinds()[-1] == "done"


def test_whatever_is_not_refused_stands_and_hovers() -> None:
    # Given a vehicle drawn from the whole range of rings, sizes, springs and masses
    chance, flown = random.Random(1), 0
    base = load_built_in("hexa").model_dump()
    for seed in range(DRAWN):
        radius_m, count = chance.uniform(0.1, 0.4), chance.choice((4, 6, 8))
        rotors = [rotor | {"spring": chance.random() < 0.5} for rotor in ring(count, radius_m)]
        geometry = base["geometry"] | {
            "hub_radius_m": 0.3 * radius_m,
            "arm_length_m": 0.7 * radius_m,
            "guard_radius_m": chance.uniform(0.03, 0.15),
            "foot_depth_m": chance.uniform(0.03, 0.15),
        }
        mass_kg = chance.uniform(0.5, 3.0)
        inertia = [mass_kg * (share * radius_m) ** 2 for share in (0.55, 0.6, 0.75)]
        drawn = {**base, "rotors": rotors, "geometry": geometry, "mass_kg": mass_kg, "inertia_kg_m2": inertia}
        try:
            airframe = Airframe.model_validate(drawn)
        except ValidationError:
            continue
        plant = Plant(airframe, Scene(), seed)
        began_m = plant.state.body[:3].copy()
        # When it stands for a second, and then is asked to hover for eight
        for _ in range(250):
            plant.step(None, armed=False)
        assert math.dist(plant.state.body[:3], began_m) < 0.02
        for _ in range(2000):
            plant.step(TrajectorySetpoint(position_ned_m=(0.0, 0.0, -1.5), yaw_rad=0.0), armed=True)
        # Then it is there
        assert math.dist(plant.state.body[:3], (0.0, 0.0, -1.5)) < 0.3, drawn
        flown += 1
    assert flown > DRAWN // 4
