"""The pilot chooses a mode at any instant of a recovery, on the simulated vehicle: from then on he alone has it."""

from typing import Any

import pytest

from bench.fly.copies import in_a_copy
from bench.fly.packets import ARM, GROUND_STATION, SET_MODE, custom_mode, decoded, made
from companion.autopilot.px4.modes import AUTO_LAND, AUTO_LOITER, POSCTL
from tests.flying import Flight
from tests.missions.test_confirming import ITEMS
from tests.simulated import simulated, wall

pytestmark = pytest.mark.flight

# CURRENT_MODE comes twice a second, as from PX4; the vehicle takes an interval to obey, and the packet one to arrive.
REPORTED_WITHIN = 125 + 2
# A heartbeat alone pauses the setpoints; the next report ends the flight.
WATCHED = REPORTED_WITHIN + 125


def flies(message: Any) -> bool:
    """A setpoint, or a command that asks for a mode or for motors."""
    is_command = message.get_type() == "COMMAND_LONG" and message.command in (SET_MODE, ARM)
    return is_command or message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"


def taken_over(air: Flight, mode: int) -> dict[str, Any]:
    """After how many intervals the vehicle reported the pilot's mode, and what the companion sent from then on."""
    to = {"target_system": 1, "target_component": 1, "command": SET_MODE}
    wish = {"param1": 1.0, "param2": float(mode >> 16 & 0xFF), "param3": float(mode >> 24)}
    asks = made("COMMAND_LONG", to | wish, GROUND_STATION)
    sticks = made("MANUAL_CONTROL", {"target": 1, "z": 500}, GROUND_STATION)
    reported, sent, step = None, [], air.vehicle.step
    heard: list[int | None] = []

    def listened(received: bytes) -> list[bytes]:
        packets = step(received)
        heard[:] = map(custom_mode, packets)
        return packets

    air.vehicle.step = listened
    for interval in range(WATCHED):
        air.step(others=sticks + (asks if interval == 0 else b""))
        if reported is None and mode in heard:
            reported = interval
        if reported is not None:
            messages = (decoded(frame) for at_us, frame in air.sent if at_us == air.now_us)
            sent += [message.get_type() for message in messages if flies(message)]
    return {"reported": reported, "sent": sent, "state": air.state, "mode": air.companion.status().vehicle_mode}


def recovers_on(air: Flight) -> bool:
    """Whether it still recovers when a mode that is chosen now is reported: until then nobody can know of it."""
    for _ in range(REPORTED_WITHIN):
        air.step()
    return bool(air.state == "recovering")


# In intervals, with no part in common with the periods of the streams.
@pytest.mark.parametrize(
    ("mode", "name", "every", "also"),
    [
        (POSCTL, "POSCTL", 37, []),
        pytest.param(AUTO_LOITER, "AUTO.LOITER", 101, [], marks=pytest.mark.slow),
        # After the recovery the mission lands, too, and may do so before a second message says what the pilot chose.
        pytest.param(AUTO_LAND, "AUTO.LAND", 101, ["landing"], marks=pytest.mark.slow),
    ],
)
def test_a_pilots_mode_at_any_instant_of_a_recovery_is_followed_by_no_setpoint(mode, name, every, also):
    # Given a vehicle that recovers from a hit on a wall
    air = simulated(ITEMS, on_collision={"then": "continue", "max_hits": 2}, sim={"walls": [wall(3.0)]})
    air.run_to("recovering")
    tried = 0
    while in_a_copy(lambda: recovers_on(air)):
        # When the pilot chooses a mode at this instant
        found = in_a_copy(lambda: taken_over(air, mode))
        # Then from the step on that hears of it nothing is sent that flies, and the mode is his
        assert found["reported"] is not None and found["reported"] <= REPORTED_WITHIN, (tried, found)
        assert (found["sent"], found["mode"]) == ([], name), (tried, found)
        assert found["state"] in ("aborted", *also), (tried, found)
        tried += 1
        for _ in range(every):
            air.step()
    assert tried * every > 150
