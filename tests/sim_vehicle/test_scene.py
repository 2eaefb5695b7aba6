"""The `sim:` part of a mission file and airframe files: what is refused, and with which words."""

from collections.abc import Callable

import pytest
from pydantic import ValidationError

from sim_vehicle.airframe import Airframe, load_built_in
from sim_vehicle.errors import AirframeError, SceneError
from sim_vehicle.hil.vehicle import HilVehicle
from sim_vehicle.json.vehicle import JsonVehicle
from sim_vehicle.scene import Scene, check_start_is_free, check_wind_can_be_held
from sim_vehicle.vehicle import SimulatedVehicle


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
    ("wall", "free"),
    [
        *(({"point_ned_m": [north_m, 0, 0]}, False) for north_m in (-0.2, 0.0, 0.2)),
        *(({"point_ned_m": [north_m, 0, 0]}, True) for north_m in (0.23, 2.0)),
        ({"point_ned_m": [0, 3, 0], "width_m": 1, "height_m": 2}, True),
    ],
)
def test_a_wall_through_the_start_is_refused(wall: dict[str, object], free: bool) -> None:
    scene = Scene.model_validate({"walls": [{**wall, "normal_ned": [-1, 0, 0]}]})
    airframe = load_built_in("foldable")
    if free:
        check_start_is_free(scene, airframe)
    else:
        with pytest.raises(SceneError, match=r"sim\.walls\.0: 'wall 1' passes through"):
            check_start_is_free(scene, airframe)


@pytest.mark.parametrize("vehicle", [SimulatedVehicle, HilVehicle, JsonVehicle])
def test_what_moves_before_anybody_arms_it_is_refused(vehicle: Callable[[Airframe, Scene, int], object]) -> None:
    """Given feet so stiff that no step of the physics follows them, then no vehicle is made of it."""
    data = load_built_in("rigid").model_dump()
    data["surface"]["foot"]["contact_time_s"] = 1e-5
    with pytest.raises(AirframeError, match=r"rigid moves by .* disarmed; see"):
        vehicle(Airframe.model_validate(data), Scene(), 1)


@pytest.mark.parametrize(("wind_ned_m_s", "is_held"), [((0, 24, 0), True), ((18, 18, 0), False), ((0, 0, 20), False)])
def test_a_wind_that_the_vehicle_cannot_lean_against_is_refused(wind_ned_m_s: list[float], is_held: bool) -> None:
    # foldable leans by 30 degrees: its weight of 10.9 N times tan 30 degrees is 6.3 N, by its drag 25 m/s
    scene = Scene.model_validate({"wind_ned_m_s": wind_ned_m_s})
    if is_held:
        check_wind_can_be_held(scene, load_built_in("foldable"))
    else:
        with pytest.raises(SceneError, match="choose less wind"):
            check_wind_can_be_held(scene, load_built_in("foldable"))
