"""Whether the vehicle stands on the ground, judged as PX4 does: from its own estimate and its own demand.

Source: PX4's land_detector/MulticopterLandDetector.cpp and the parameters LNDMC_* and MPC_THR_MIN.
It has no sensor for the ground, so a descent that stalls on an obstacle looks like a landing.
"""

import math

from sim_vehicle.airframe import NO_THRUST_SHARE
from sim_vehicle.estimator.estimate import Estimate
from sim_vehicle.parameters.store import Parameters
from sim_vehicle.quantities import Vector3

# On the ground the thresholds widen, so that idling motors do not look like a takeoff.
WIDER_WHEN_LANDED = 2.5
# A demand faster than this many times LNDMC_Z_VEL_MAX is a commanded descent.
DESCENT_FACTOR = 1.1
# How far between MPC_THR_MIN and hover thrust still counts as low.
LOW_THRUST_SHARE = 0.6
# Each of the three stages has to last a third of the detection time of 1 s.
STAGE_US = 1_000_000 // 3
# Specific force below this for this long is a fall, never a landing.
FREE_FALL_M_S2 = 2.0
FREE_FALL_US = 300_000


class _Stage:
    """True once its condition has held for long enough; false at once when it does not."""

    def __init__(self, holds_us: int, state: bool) -> None:
        self.state = state
        self._holds_us = holds_us
        self._since_us: int | None = None

    def update(self, condition: bool, now_us: int) -> bool:
        if not condition:
            self.state = False
            self._since_us = None
            return False
        if self._since_us is None:
            self._since_us = now_us
        if now_us - self._since_us >= self._holds_us:
            self.state = True
        return self.state


class LandDetector:
    """Ground contact, then maybe landed, then landed. A disarmed vehicle is landed."""

    def __init__(self, hover_thrust_fraction: float, parameters: Parameters) -> None:
        self._hover_thrust = hover_thrust_fraction
        self._parameters = parameters
        self._contact = _Stage(STAGE_US, True)
        self._maybe = _Stage(STAGE_US, True)
        self._landed = _Stage(STAGE_US, True)
        self._free_fall = _Stage(FREE_FALL_US, False)
        self.ground_contact = True
        """First stage: commanded down, yet not moving. The position control gives way here."""
        self.maybe_landed = True
        """Second stage: and next to no thrust. Disarming by command is accepted from here on."""
        self.landed = True
        """Third stage: all of it for long enough."""

    def begin_in_flight(self) -> None:
        """The vehicle has been flying for a while."""
        for stage in (self._contact, self._maybe, self._landed):
            stage.state = False
        self.ground_contact = self.maybe_landed = self.landed = False

    def update(
        self, estimate: Estimate, armed: bool, asked_down_m_s: float | None, controls_climb: bool = True
    ) -> None:
        """Take one estimate; ``asked_down_m_s`` is the mode's own demand, None where it has none.

        ``controls_climb`` off: attitude or rates are asked for, so no descent can be; thrust alone must be low.
        """
        now_us, thrust_fraction = estimate.time_boot_us, estimate.thrust_fraction
        if not armed:
            for stage in (self._contact, self._maybe, self._landed):
                stage.update(True, now_us)
                stage.state = True
            self.ground_contact = self.maybe_landed = self.landed = True
            return
        on_ground = self.maybe_landed or self.landed
        descent_m_s = DESCENT_FACTOR * self._parameters["LNDMC_Z_VEL_MAX"]
        descends = asked_down_m_s is not None and asked_down_m_s >= descent_m_s
        still = self._is_still(estimate.velocity_ned_m_s)
        self._free_fall.update(math.hypot(*estimate.specific_force_frd_m_s2) < FREE_FALL_M_S2, now_us)
        gives_way = thrust_fraction <= self._thrust(LOW_THRUST_SHARE)
        gives_way = gives_way and (descends or on_ground or not controls_climb)
        none = self._thrust(NO_THRUST_SHARE) if controls_climb else self._parameters["MPC_MANTHR_MIN"] + 0.01
        self.ground_contact = self._contact.update(gives_way and still, now_us)
        self.maybe_landed = self._maybe.update(
            thrust_fraction <= none
            and self.ground_contact
            and not self._free_fall.state
            and not self._rotates(estimate.angular_velocity_frd_rad_s),
            now_us,
        )
        self.landed = self._landed.update(self.maybe_landed, now_us)

    def _thrust(self, share: float) -> float:
        least = self._parameters["MPC_THR_MIN"]
        return least + share * (self._hover_thrust - least)

    def _is_still(self, velocity_ned_m_s: Vector3) -> bool:
        north, east, down = velocity_ned_m_s
        vertical = self._parameters["LNDMC_Z_VEL_MAX"] * (WIDER_WHEN_LANDED if self.landed else 1.0)
        return abs(down) < vertical and math.hypot(north, east) <= self._parameters["LNDMC_XY_VEL_MAX"]

    def _rotates(self, angular_velocity_frd_rad_s: Vector3) -> bool:
        limit = math.radians(self._parameters["LNDMC_ROT_MAX"]) * (WIDER_WHEN_LANDED if self.landed else 1.0)
        return math.hypot(angular_velocity_frd_rad_s[0], angular_velocity_frd_rad_s[1]) > limit
