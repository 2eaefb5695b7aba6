"""Local NED and geographic coordinates of one flight.

Source: PX4's lib/geo (MapProjection): the azimuthal equidistant projection on a sphere of 6371 km, which is what
PX4's own local position means. Heights are above mean sea level.
"""

import math
from dataclasses import dataclass
from functools import cached_property

from sim_vehicle.quantities import Vector3

# The sphere of PX4's projection between geographic and local coordinates (lib/geo).
EARTH_RADIUS_M = 6_371_000.0


@dataclass(frozen=True, slots=True)
class Place:
    """A point on the Earth; the altitude is above mean sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


# Where PX4's own simulators put their home by default, so that its users know the place.
HOME = Place(latitude_deg=47.397742, longitude_deg=8.545594, altitude_m=488.0)


@dataclass(frozen=True)
class Origin:
    """Where local NED (0, 0, 0) lies."""

    place: Place = HOME

    @cached_property
    def _sin_cos(self) -> tuple[float, float]:
        latitude_rad = math.radians(self.place.latitude_deg)
        return math.sin(latitude_rad), math.cos(latitude_rad)

    def place_at(self, position_ned_m: Vector3) -> Place:
        """The geographic place of a local position."""
        north_m, east_m, down_m = position_ned_m
        altitude_m = self.place.altitude_m - down_m
        north, east = north_m / EARTH_RADIUS_M, east_m / EARTH_RADIUS_M
        angle = math.hypot(north, east)
        if angle == 0.0:
            return Place(self.place.latitude_deg, self.place.longitude_deg, altitude_m)
        sin_0, cos_0 = self._sin_cos
        sin, cos = math.sin(angle), math.cos(angle)
        latitude = math.asin(min(max(cos * sin_0 + north * sin * cos_0 / angle, -1.0), 1.0))
        turned_deg = math.degrees(math.atan2(east * sin, angle * cos_0 * cos - north * sin_0 * sin))
        longitude_deg = math.remainder(self.place.longitude_deg + turned_deg, 360.0)
        return Place(math.degrees(latitude), longitude_deg, altitude_m)

    def position_of(self, place: Place) -> Vector3:
        """The local position of a geographic place, metres NED."""
        sin_0, cos_0 = self._sin_cos
        latitude = math.radians(place.latitude_deg)
        turned = math.radians(place.longitude_deg - self.place.longitude_deg)
        sin, cos = math.sin(latitude), math.cos(latitude)
        angle = math.acos(min(max(sin_0 * sin + cos_0 * cos * math.cos(turned), -1.0), 1.0))
        stretch = EARTH_RADIUS_M * (angle / math.sin(angle) if angle > 0.0 else 1.0)
        return (
            stretch * (cos_0 * sin - sin_0 * cos * math.cos(turned)),
            stretch * cos * math.sin(turned),
            self.place.altitude_m - place.altitude_m,
        )
