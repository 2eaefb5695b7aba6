"""What is done to a vehicle as a whole, mostly on the ground: home, stored parameters, reboot, failures on request."""

import math

from sim_vehicle.autopilot.commander.commander import Commander
from sim_vehicle.autopilot.messages import Result
from sim_vehicle.autopilot.navigator.navigator import Navigator
from sim_vehicle.geography import Origin
from sim_vehicle.hil.messages import Place
from sim_vehicle.parameters.store import Parameters


class Ground:
    """Refuses what a PX4 refuses while it is armed."""

    def __init__(self, parameters: Parameters, origin: Origin, commander: Commander, navigator: Navigator) -> None:
        self._parameters = parameters
        self._origin = origin
        self._arming, self._battery = commander.arming, commander.battery
        self._positioning = commander.positioning
        self._navigator = navigator
        self.wants_reboot = False
        """To be done by whoever switches the software on and off, once the answer is out."""

    def set_home(self, place: Place | None, yaw_rad: float) -> Result:
        """DO_SET_HOME: to a place, or to where the vehicle is; a heading that is not a number is north."""
        if not self._parameters["COM_HOME_EN"]:
            return Result.DENIED
        if place is None:
            self._navigator.set_home_here()
        else:
            self._navigator.set_home(self._origin.position_of(place), 0.0 if math.isnan(yaw_rad) else yaw_rad)
        return Result.ACCEPTED

    def save_parameters(self) -> Result:
        """PREFLIGHT_STORAGE: nothing is to be done, for they are always kept."""
        return Result.TEMPORARILY_REJECTED if self._arming.armed else Result.ACCEPTED

    def reset_parameters(self) -> Result:
        """PREFLIGHT_STORAGE: back to the defaults."""
        if self._arming.armed:
            return Result.TEMPORARILY_REJECTED
        self._parameters.reset()
        return Result.ACCEPTED

    def reboot(self) -> Result:
        """PREFLIGHT_REBOOT_SHUTDOWN."""
        if self._arming.armed:
            return Result.DENIED
        self.wants_reboot = True
        return Result.ACCEPTED

    def lose_gps(self, is_off: bool) -> Result:
        """INJECT_FAILURE: no fix any more, or again one."""
        if not self._parameters["SYS_FAILURE_EN"]:
            return Result.DENIED
        self._positioning.gps_is_off = is_off
        return Result.ACCEPTED

    def empty_battery(self, is_off: bool) -> Result:
        """INJECT_FAILURE: the charge is gone, or there again."""
        if not self._parameters["SYS_FAILURE_EN"]:
            return Result.DENIED
        self._battery.is_forced_empty = is_off
        return Result.ACCEPTED
