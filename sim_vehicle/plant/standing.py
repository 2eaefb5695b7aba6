"""Whether a vehicle can be begun with: it fits, the wind lets it, and disarmed it stays where it stands."""

import math

import numpy as np

from sim_vehicle.airframe import Airframe
from sim_vehicle.errors import AirframeError
from sim_vehicle.physics.layout import GRAVITY_M_S2
from sim_vehicle.plant.plant import Plant
from sim_vehicle.scene import Scene, check_start_is_free, check_wind_can_be_held

# What lies in the ground, or on feet too stiff to be simulated, leaps within the first contact, some milliseconds.
_WATCHED_S = 0.2
# Besides what feet give under the weight, on one of them g (T / pi)^2 by their contact time T: they swing as far again.
# A vehicle that stands does not tilt.
_MOVED_M, _TILTED_RAD = 0.01, math.radians(2.0)


def check_start(airframe: Airframe, scene: Scene) -> None:
    """Raises SceneError for what is in its way, AirframeError where it moves before anybody arms it."""
    check_start_is_free(scene, airframe)
    check_wind_can_be_held(scene, airframe)
    # Its own filter would take half a second to load, and moves nothing.
    estimate = airframe.estimate.model_copy(update={"kind": "markov"})
    plant = Plant(
        airframe.model_copy(update={"estimate": estimate}),
        scene.model_copy(update={"faults": ()}),
        scene.seed,
        keeps_path=False,
    )
    began = plant.state.body.copy()
    for _ in range(math.ceil(_WATCHED_S * 1e6 / plant.interval_us)):
        plant.step(None, armed=False)
    moved_m = float(np.linalg.norm(plant.state.body[:3] - began[:3]))
    _, x, y, _ = plant.state.body[6:10]
    tilt_rad = 2.0 * math.asin(min(1.0, math.hypot(x, y)))
    gives_m = GRAVITY_M_S2 * (airframe.surface.foot.contact_time_s / math.pi) ** 2
    # Written so that what is not a number is refused, too.
    if not (moved_m <= _MOVED_M + 2.0 * gives_m and tilt_rad <= _TILTED_RAD):
        raise AirframeError(
            f"{airframe.name} moves by {moved_m:.2g} m and tilts by {math.degrees(tilt_rad):.2g} degrees within "
            f"{_WATCHED_S:g} s, disarmed; see what of its geometry or surface.foot differs from an airframe that stands"
        )
