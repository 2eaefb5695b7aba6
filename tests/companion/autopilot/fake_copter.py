"""The scripted vehicle as ArduPilot's Copter has it on the wire: its modes, its take-off, its parameters."""

from dataclasses import dataclass, field

from pymavlink.dialects.v20 import development as mav

from tests.companion.fake_vehicle import LAND, LOITER, OFFBOARD, FakeVehicle

GUIDED, COPTER_LAND, BRAKE = 4, 9, 17
NUMBERS = {OFFBOARD: GUIDED, LAND: COPTER_LAND, LOITER: BRAKE}
BY_NUMBER = {number: mode for mode, number in NUMBERS.items()}
SET_MODE, TAKE_OFF, ARM, AUX_FUNCTION = 176, 22, 400, 218


@dataclass
class FakeCopter(FakeVehicle):
    autopilot: int = 3
    flight_version: int = 4 << 24 | 6 << 16
    parameters: dict[str, float] = field(default_factory=lambda: {"GUID_TIMEOUT": 0.3, "GUID_OPTIONS": 8.0})
    takes_off_to_m: float | None = None

    def send(self, message) -> None:
        kind = message.get_type()
        if kind == "CURRENT_MODE":
            # What it has in its place, as often as it is asked for.
            base = 0x59 | (0x80 if self.armed else 0)
            status = 5 if self.failsafe else 4 if self.armed else 3
            message = mav.MAVLink_heartbeat_message(self.vehicle_type, self.autopilot, base, self.mode, status, 3)
            kind = "HEARTBEAT"
        if kind == "HEARTBEAT":
            message.custom_mode = NUMBERS.get(self.mode, self.mode)
        elif kind == "AUTOPILOT_VERSION":
            message.flight_sw_version = self.flight_version
        super().send(message)

    def hear(self, message) -> None:
        kind = message.get_type()
        if kind == "PARAM_REQUEST_READ" and message.param_id in self.parameters:
            value, kinds = self.parameters[message.param_id], {"GUID_OPTIONS": mav.MAV_PARAM_TYPE_INT32}
            number = kinds.get(message.param_id, mav.MAV_PARAM_TYPE_REAL32)
            self.send(mav.MAVLink_param_value_message(message.param_id.encode(), value, number, 1, 0))
            return
        super().hear(message)
        if kind == "SET_POSITION_TARGET_LOCAL_NED" and self.landed == 1:
            # Neither does it leave the ground by itself, nor after a take-off that a setpoint has ended.
            self.target = self.takes_off_to_m = None

    def obey_command(self, message) -> None:
        if message.command == SET_MODE:
            message.param2, message.param3 = (
                BY_NUMBER[int(message.param2)] >> 16 & 0xFF,
                BY_NUMBER[int(message.param2)] >> 24,
            )
        super().obey_command(message)
        if message.command == TAKE_OFF and self.armed and self.obey(TAKE_OFF, self.counts[TAKE_OFF]):
            self.takes_off_to_m = message.param7

    def move(self) -> None:
        if self.takes_off_to_m is not None and self.target is None:
            n, e, d = self.start_ned_m
            up = (0.0,) * 3
            self.target = mav.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, 1, 0xDF8, n, e, d - self.takes_off_to_m, *up, *up, 0.0, 0.0
            )
        super().move()
