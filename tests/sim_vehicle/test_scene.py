"""Files of scenes and airframes, rotors and parameters among them: what is refused, and that drawn ones hover."""

import math
import random
import re
from collections.abc import Callable
from contextlib import nullcontext
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from sim_vehicle.airframe import Airframe, built_in_airframes, load_built_in, with_base
from sim_vehicle.control.setpoint import TrajectorySetpoint
from sim_vehicle.errors import AirframeError, SceneError
from sim_vehicle.hil.parameters import as_airframe_file, px4_parameters
from sim_vehicle.hil.vehicle import HilVehicle
from sim_vehicle.json.vehicle import JsonVehicle
from sim_vehicle.parameters.store import TABLE, definitions
from sim_vehicle.physics.layout import allocation, arms_of
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene, check_start_is_free, check_wind_can_be_held
from sim_vehicle.vehicle import SimulatedVehicle
from tests.simulated import simulated


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ({"wals": []}, "Extra inputs"),
        ({"walls": [{"point_ned_m": [1, 0, 0], "normal_ned": [0, 0, 0]}]}, "no direction"),
        ({"walls": [{"point_ned_m": [1, 0, float("nan")], "normal_ned": [1, 0, 0]}]}, "finite"),
        ({"start": {"position_ned_m": [0, 0, -2]}}, "starts standing on the ground"),
        ({"seed": -1}, "greater than or equal to 0"),
    ],
)
def test_bad_parts_are_refused(part: dict[str, object], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        Scene.model_validate(part)


@pytest.mark.parametrize(
    ("obstacle", "free"),
    [
        *(({"point_ned_m": [north_m, 0, 0]}, False) for north_m in (-0.2, 0.0, 0.2)),
        *(({"point_ned_m": [north_m, 0, 0]}, True) for north_m in (0.23, 2.0)),
        ({"point_ned_m": [0, 3, 0], "width_m": 1, "height_m": 2}, True),
        # A pole's axis a metre away, of which its radius leaves 0.3 and 0.2 m
        *(({"point_ned_m": [0, 1, 0], "radius_m": radius_m}, radius_m < 0.75) for radius_m in (0.7, 0.8)),
    ],
)
def test_an_obstacle_through_the_start_is_refused(obstacle: dict[str, object], free: bool) -> None:
    kind, keys = ("poles", {}) if "radius_m" in obstacle else ("walls", {"normal_ned": [-1, 0, 0]})
    scene = Scene.model_validate({kind: [obstacle | keys]})
    with nullcontext() if free else pytest.raises(SceneError, match=rf"sim\.{kind}\.0: '{kind[:4]} 1' passes through"):
        check_start_is_free(scene, load_built_in("foldable"))


@pytest.mark.parametrize("vehicle", [SimulatedVehicle, HilVehicle, JsonVehicle])
def test_what_moves_before_anybody_arms_it_is_refused(vehicle: Callable[[Airframe, Scene, int], object]) -> None:
    """Given feet so stiff that no step of the physics follows them, then no vehicle is made of it."""
    data = load_built_in("rigid").model_dump()
    data["surface"]["foot"]["contact_time_s"] = 1e-5
    with pytest.raises(AirframeError, match=r"rigid moves by .* disarmed; see"):
        vehicle(Airframe.model_validate(data), Scene(), 1)
    # As soft as grass they give by more than a centimetre, and stand
    data["surface"]["foot"] |= {"contact_time_s": 0.08, "restitution": 0.05}
    vehicle(Airframe.model_validate(data), Scene(), 1)


@pytest.mark.parametrize(("wind_ned_m_s", "is_held"), [((0, 24, 0), True), ((18, 18, 0), False), ((0, 0, 20), False)])
def test_a_wind_that_the_vehicle_cannot_lean_against_is_refused(wind_ned_m_s: list[float], is_held: bool) -> None:
    # foldable leans by 30 degrees: its weight of 10.9 N times tan 30 degrees is 6.3 N, by its drag 25 m/s
    scene = Scene.model_validate({"wind_ned_m_s": wind_ned_m_s})
    with nullcontext() if is_held else pytest.raises(SceneError, match="choose less wind"):
        check_wind_can_be_held(scene, load_built_in("foldable"))


# The interval of all built-in airframes.
DT_S = 0.004
SIDES = ("cw", "cw", "ccw", "ccw")


def ring(count: int, radius_m: float) -> list[dict[str, Any]]:
    """Evenly around the centre, turning one way and the other; half a step off the nose."""
    angles = [2.0 * math.pi * (number + 0.5) / count for number in range(count)]
    return [
        {"place_frd_m": (radius_m * math.cos(angle), radius_m * math.sin(angle)), "direction": turns}
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
        ({"inertia_kg_m2": (0.003, 0.003, 0.007)}, "which no body has"),
        ({"arms": {"tip_mass_kg": 0.3}}, r"arms\.tip_mass_kg: 4 ends of 0\.3 kg have more mass"),
        ({"control": {"attitude_frequency_rad_s": 60.0}}, "the motors' lag lets roll and pitch swing"),
        ({"control": {"position_p_per_s": 4.0}}, "swing each other up sideways; lower control"),
        ({"control": {"climb_p_per_s": 80.0}}, "swing each other up in height"),
        ({"mass_kg": 1.5}, r"raise motors\.max_thrust_n"),
        ({"motors": {"idle_fraction": 0.2}}, r"lower motors\.idle_fraction to 0\.18 or less"),
        ({"geometry": {"foot_depth_m": 0.04}}, r"the hub, .* would begin in the ground"),
        ({"geometry": {"guard_height_m": 0.17}}, r"the guards, .* would begin in the ground"),
    ],
)  # fmt: skip
def test_an_airframe_that_is_no_body_or_cannot_stand_fly_or_land_is_refused(part: dict[str, Any], words: str) -> None:
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


def test_no_name_ends_the_comment_that_it_is_in_a_shells_file() -> None:
    hostile = with_base({"based_on": "foldable", "name": "a\nreboot", "description": "b\n\nreboot\n"})
    assert "\n# @name a reboot: b reboot\n" in as_airframe_file(Airframe.model_validate(hostile))


@pytest.mark.parametrize(("name", "kind"), [("hexa", "hexarotor"), ("octo", "octorotor"), ("racer", "quadrotor")])
def test_each_meets_a_wall_recovers_and_lands(name: str, kind: str) -> None:
    flight = simulated("wall", f"sim.airframe={name}")
    flight.run_to_end()
    assert kind in flight.event("connected").text
    assert len(flight.hits) == 1 and flight.hits[0].closing_speed_m_s == pytest.approx(2.0, abs=0.2)
    assert flight.event("recovered").text.startswith("recovered: settled") and flight.kinds()[-1] == "done"


def drawn_from_the_whole_schema(seed: int) -> dict[str, Any]:
    """Any of the built-in airframes with every number up to three times more or less, and with any rotors."""
    chance = random.Random(seed)

    def varied(value: Any) -> Any:
        match value:
            case bool() | int() | str() | None:
                return value
            case float():
                return value * math.exp(chance.uniform(-math.log(3.0), math.log(3.0)))
            case dict():
                return {key: varied(part) for key, part in value.items() if not key.endswith("_centre_m")}
        return type(value)(map(varied, value))

    drawn = load_built_in(chance.choice(built_in_airframes())).model_dump()
    drawn |= {key: varied(drawn[key]) for key in drawn if key not in ("rotors", "sensors", "estimator")}
    drawn["arms"]["stop"]["restitution"] = chance.uniform(0.05, 0.95)
    drawn["surface"]["foot"]["restitution"] = chance.uniform(0.05, 0.95)
    # What independent numbers hardly ever fit together in
    geometry, control, (x, y, _) = drawn["geometry"], drawn["control"], drawn["inertia_kg_m2"]
    drawn["inertia_kg_m2"] = x, y, (z := chance.uniform(max(x, y), 1.05 * (x + y)))
    radius_m, count = geometry["hub_radius_m"] + geometry["arm_length_m"], chance.choice((4, 6, 8))
    geometry["guard_radius_m"] = chance.uniform(0.2, 1.1) * radius_m * math.sin(math.pi / count)
    most_kg = min(z / radius_m**2, drawn["mass_kg"]) / count
    drawn["arms"]["tip_mass_kg"] = chance.uniform(0.1, 1.1) * most_kg
    drawn["motors"]["max_thrust_n"] = drawn["mass_kg"] * 9.81 / count / chance.uniform(0.1, 1.0)
    control["velocity_p_per_s"] = (p := chance.uniform(0.1, 0.6) * control["attitude_frequency_rad_s"])
    control["velocity_i_per_s2"] = chance.uniform(0.0, 0.4) * p * p
    control["position_p_per_s"] = chance.uniform(0.1, 0.5) * p
    rotors = [rotor | {"spring": chance.random() < 0.5} for rotor in ring(count, radius_m)]
    drawn["imu"]["above_centre_m"] = chance.uniform(-0.02, 0.05)
    return drawn | {"rotors": rotors}


@pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.slow)])
def test_whatever_is_not_refused_stands_and_hovers(count: int) -> None:
    flown = 0
    for seed in range(count):
        try:
            airframe = Airframe.model_validate(drawn_from_the_whole_schema(seed))
        except ValidationError:
            continue
        plant = Plant(airframe, Scene(), seed)
        body = plant.state.body
        began_m = body[:3].copy()
        # When it stands for five seconds, then it is still and upright
        for _ in range(round(5.0 / DT_S)):
            plant.step(None, armed=False)
            assert math.dist(body[:3], began_m) < 0.02, seed
        assert body[7] ** 2 + body[8] ** 2 < 1e-4, seed
        # When it is asked to hover, then it is there after some time constants of its loop, for two seconds
        there_s = 5.0 + 5.0 / airframe.control.position_p_per_s
        for step in range(round((there_s + 2.0) / DT_S)):
            plant.step(TrajectorySetpoint(position_ned_m=(0.0, 0.0, -1.5), yaw_rad=0.0), armed=True)
            assert step * DT_S < there_s or math.dist(body[:3], (0.0, 0.0, -1.5)) < 0.3, seed
        flown += 1
    assert flown > count // 20


ROOT = Path(__file__).parents[2]
DOCUMENT = (ROOT / "docs" / "reference" / "simulated-vehicle.md").read_text()


def test_every_parameter_steers_the_vehicle_or_is_asked_for_by_clients():
    # Given what the page lists as asked for by name
    (listed,) = re.findall(r"^\| asked for by clients alone \| (.*) \|$", DOCUMENT, re.M)
    asked_for = re.findall(r"`([\w*]+)`", listed)
    paths = [path for package in ("sim_vehicle", "rebound_cli") for path in (ROOT / package).rglob("*.py")]
    read = "\n".join(path.read_text() for path in paths)
    unread = {name for name in definitions() if not re.search(rf"[\"']{name}[\"']", read)}
    named = {name for name in definitions() if any(fnmatch(name, pattern) for pattern in asked_for)}
    assert unread == named, f"in {TABLE.name}, but nothing reads them"
