"""A simulated vehicle and MAVSDK's blocking plugins on it, for flights that are shorter than real time."""

from collections.abc import Iterator
from contextlib import contextmanager

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.telemetry import FlightMode, Telemetry
from simulator import simulator, wait_until

METRE_DEG = 1.0 / 111_320.0


class Vehicle:
    """Connected, healthy, on the ground."""

    def __init__(self, port: int) -> None:
        self.mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
        self.mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        self.system = self.mavsdk.first_autopilot(30.0)
        assert self.system is not None
        self.action, self.telemetry = Action(self.system), Telemetry(self.system)
        self.texts: list[str] = []
        self.telemetry.subscribe_status_text(lambda text, _: self.texts.append(text.text.strip()))
        wait_until(self.telemetry.health_all_ok, 30, "healthy")

    @property
    def place(self) -> tuple[float, float]:
        position = self.telemetry.position()
        return position.latitude_deg, position.longitude_deg

    @property
    def ned(self) -> tuple[float, float, float]:
        position = self.telemetry.position_velocity_ned().position
        return position.north_m, position.east_m, position.down_m

    def take_off(self, height_m: float = 3.0) -> None:
        self.action.set_takeoff_altitude(height_m)
        self.action.arm()
        self.action.takeoff()
        wait_until(lambda: -self.ned[2] > height_m - 0.8 and self.flies(FlightMode.HOLD), 30, "taken off")

    def flies(self, mode: FlightMode) -> bool:
        return self.telemetry.flight_mode() == mode

    def wait_for_landing(self) -> None:
        wait_until(lambda: not self.telemetry.armed(), 60, "landed and disarmed")


@contextmanager
def flown(speed: float) -> Iterator[Vehicle]:
    """So many times faster than the clock."""
    with simulator("--speed", str(speed)) as simulated:
        connected = Vehicle(simulated.companion_port)
        yield connected
        connected.mavsdk.destroy()
