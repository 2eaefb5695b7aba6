"""Flights of the kinematic vehicle that tests begin with, and what they measure places by."""

import math

from sim_vehicle.autopilot.commands import COMPONENT_ARM_DISARM, DO_SET_MODE
from sim_vehicle.autopilot.flight_commands import NAV_TAKEOFF
from sim_vehicle.autopilot.messages import PositionTarget, Result, StickInput
from sim_vehicle.autopilot.mission_protocol import mission_items as kinds
from sim_vehicle.autopilot.mission_protocol.mission_items import MissionType, StoredItem
from sim_vehicle.autopilot.mode_numbers import NUMBERS
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.geography import Origin
from tests.sim_vehicle.autopilot.kinematic_plant import Flight

ORIGIN = Origin()
LINK = 2


def hovering(height_m: float = 5.0, **parameters: float) -> Flight:
    """In hold, taken off to that height."""
    flight = Flight(None, MIS_TAKEOFF_ALT=height_m, **parameters)
    assert flight.ask(NAV_TAKEOFF) is Result.ACCEPTED
    assert flight.ask(COMPONENT_ARM_DISARM, 1) is Result.ACCEPTED
    flight.fly_until(lambda: flight.autopilot.modes.flown is Mode.LOITER, 30.0)
    flight.fly(3.0)
    flight.autopilot.texts.clear()
    return flight


def in_offboard(setpoint: PositionTarget, **parameters: float) -> Flight:
    """The same in OFFBOARD, that setpoint having just been sent."""
    flight = hovering(5.0, **parameters)
    flight.fly(0.2, setpoint)
    assert set_mode(flight, Mode.OFFBOARD) is Result.ACCEPTED
    flight.fly(0.5, setpoint)
    flight.autopilot.receive(setpoint)
    return flight


def north_east(flight: Flight) -> tuple[float, float]:
    """Where it is."""
    north, east, _ = flight.state.position_ned_m
    return north, east


def set_mode(flight: Flight, mode: Mode) -> Result | None:
    """DO_SET_MODE."""
    custom = NUMBERS[mode].custom_mode
    return flight.ask(DO_SET_MODE, 1, custom >> 16 & 0xFF, custom >> 24)


def place(north_m: float, east_m: float) -> tuple[float, float]:
    """Latitude and longitude of a local place."""
    there = ORIGIN.place_at((north_m, east_m, 0.0))
    return there.latitude_deg, there.longitude_deg


def item(
    command: int,
    north_m: float = 0.0,
    east_m: float = 0.0,
    up_m: float = 5.0,
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, math.nan),
    autocontinue: int = 1,
) -> StoredItem:
    """An item with a place, its height above home."""
    return StoredItem(kinds.FRAME_GLOBAL_RELATIVE_INT, command, autocontinue, (*params, *place(north_m, east_m), up_m))


def action(command: int, *params: float) -> StoredItem:
    """An item without a place."""
    a, b, c, d, e, f, g = (*params, *[0.0] * (7 - len(params)))
    return StoredItem(kinds.FRAME_MISSION, command, 1, (a, b, c, d, e, f, g))


def upload(flight: Flight, *items: StoredItem, kind: MissionType = MissionType.MISSION) -> None:
    """Store a list as a link would."""
    flight.autopilot.missions.replace(kind, items)
    flight.fly(0.06)


def sticks(
    flight: Flight, seconds: float, roll: float = 0, pitch: float = 0, throttle: float = 0, yaw: float = 0
) -> None:
    """Hold the sticks, sent at 50 Hz."""
    flight.fly(seconds, StickInput(roll, pitch, throttle, yaw, LINK), rate_hz=50.0)
