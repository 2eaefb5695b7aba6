"""Landing as PX4 detects it, from the estimate and the demand alone."""

import pytest

from sim_vehicle.autopilot.land_detector import LandDetector
from sim_vehicle.parameters.store import Parameters
from tests.sim_vehicle.autopilot.kinematic_plant import STANDING

STEP_US = 8_000
STILL = (0.0, 0.0, 0.0)
HOVER = 0.5
# 60 % and 10 % of the way from PX4's least thrust, 0.12, to hover.
LOW, NONE = 0.34, 0.15


class Detection:
    """A detector that has taken off, fed at 125 Hz."""

    def __init__(self) -> None:
        self.detector = LandDetector(HOVER, Parameters())
        self.now_us = 0
        self.feed(0.1, thrust=HOVER, asked_down=None)
        assert not self.detector.landed

    def feed(self, seconds, thrust, asked_down=0.7, velocity=STILL, rate=STILL, force=(0, 0, -9.8), armed=True):
        estimate = STANDING._replace(
            velocity_ned_m_s=velocity,
            angular_velocity_frd_rad_s=rate,
            specific_force_frd_m_s2=force,
            thrust_fraction=thrust,
        )
        for _ in range(round(seconds * 1e6 / STEP_US)):
            self.now_us += STEP_US
            self.detector.update(estimate._replace(time_boot_us=self.now_us), armed, asked_down)


def test_a_landing_takes_a_second_in_three_stages():
    detection = Detection()
    stages = []
    for _ in range(200):
        detection.feed(0.008, thrust=NONE)
        detector = detection.detector
        stages.append((detector.ground_contact, detector.maybe_landed, detector.landed))
    first = [next(i for i, stage in enumerate(stages) if stage[which]) * 0.008 for which in range(3)]
    assert first == pytest.approx([1 / 3, 2 / 3, 1.0], abs=0.03)


@pytest.mark.parametrize(
    "hinders",
    [
        {"asked_down": None},
        {"asked_down": 0.25},
        {"asked_down": -1.0},
        {"velocity": (0.0, 0.0, 0.3)},
        {"velocity": (1.6, 0.0, 0.0)},
        {"thrust": LOW + 0.02},
    ],
    ids=str,
)
def test_what_keeps_it_flying(hinders):
    detection = Detection()
    detection.feed(5.0, **{"thrust": NONE, **hinders})
    assert not detection.detector.ground_contact


@pytest.mark.parametrize("hinders", [{"rate": (0.4, 0.0, 0.0)}, {"thrust": LOW}, {"force": (0, 0, -1)}], ids=str)
def test_ground_contact_alone_is_no_landing(hinders):
    detection = Detection()
    detection.feed(5.0, **{"thrust": NONE, **hinders})
    assert detection.detector.ground_contact
    assert not detection.detector.maybe_landed
