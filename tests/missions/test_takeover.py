"""The pilot chooses a mode at any instant of a recovery, on the simulated vehicle: from then on he alone has it."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mav

from companion.autopilot.px4.modes import AUTO_LAND, AUTO_LOITER, POSCTL
from tests.flying import Flight, in_a_child
from tests.missions.test_confirming import ITEMS
from tests.simulated import simulated, wall

pytestmark = pytest.mark.flight

GROUND_STATION = mav.MAVLink(None, srcSystem=255, srcComponent=190)
# CURRENT_MODE comes twice a second, as from PX4; the vehicle takes an interval to obey, and the packet one to arrive.
REPORTED_WITHIN = 125 + 2
# A heartbeat alone pauses the setpoints; the next report ends the flight.
WATCHED = REPORTED_WITHIN + 125
SET_MODE, ARM = 176, 400


def flies(message: Any) -> bool:
    """A setpoint, or a command that asks for a mode or for motors."""
    is_command = message.get_type() == "COMMAND_LONG" and message.command in (SET_MODE, ARM)
    return is_command or message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"


def taken_over(air: Flight, mode: int) -> dict[str, Any]:
    """After how many intervals the vehicle reported the pilot's mode, and what the companion sent from then on."""
    fields = (1, 1, SET_MODE, 0, 1.0, float(mode >> 16 & 0xFF), float(mode >> 24), 0, 0, 0, 0)
    asks = bytes(mav.MAVLink_command_long_message(*fields).pack(GROUND_STATION))
    sticks = bytes(mav.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0).pack(GROUND_STATION))
    reported, sent, reader, step = None, [], mav.MAVLink(None), air.vehicle.step
    heard: list[int | None] = []

    def listened(received: bytes) -> list[bytes]:
        packets = step(received)
        heard[:] = [getattr(reader.decode(bytearray(packet)), "custom_mode", None) for packet in packets]
        return packets

    air.vehicle.step = listened
    for interval in range(WATCHED):
        air.step(others=sticks + (asks if interval == 0 else b""))
        if reported is None and mode in heard:
            reported = interval
        if reported is not None:
            messages = mav.MAVLink(None).parse_buffer(bytearray(air.pending)) or []
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
    while in_a_child(lambda: recovers_on(air)):
        # When the pilot chooses a mode at this instant
        found = in_a_child(lambda: taken_over(air, mode))
        # Then from the step on that hears of it nothing is sent that flies, and the mode is his
        assert found["reported"] is not None and found["reported"] <= REPORTED_WITHIN, (tried, found)
        assert (found["sent"], found["mode"]) == ([], name), (tried, found)
        assert found["state"] in ("aborted", *also), (tried, found)
        tried += 1
        for _ in range(every):
            air.step()
    assert tried * every > 150
