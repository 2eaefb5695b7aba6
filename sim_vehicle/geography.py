"""Between geographic and local coordinates: PX4's azimuthal equidistant projection (lib/geo, MapProjection)."""

import math
from dataclasses import dataclass

Vector3 = tuple[float, float, float]

EARTH_RADIUS_M = 6_371_000.0


@dataclass(frozen=True, slots=True)
class Origin:
    """Where local (0, 0, 0) lies; altitude above mean sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float

    def local_ned_m(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> Vector3:
        """A place of the Earth in local NED."""
        lat, lon = math.radians(latitude_deg), math.radians(longitude_deg)
        lat0, lon0 = math.radians(self.latitude_deg), math.radians(self.longitude_deg)
        cos_distance = math.sin(lat0) * math.sin(lat) + math.cos(lat0) * math.cos(lat) * math.cos(lon - lon0)
        distance = math.acos(min(max(cos_distance, -1.0), 1.0))
        k = EARTH_RADIUS_M * (distance / math.sin(distance) if distance > 0.0 else 1.0)
        north = k * (math.cos(lat0) * math.sin(lat) - math.sin(lat0) * math.cos(lat) * math.cos(lon - lon0))
        return north, k * math.cos(lat) * math.sin(lon - lon0), self.altitude_m - altitude_m

    def geodetic(self, position_ned_m: Vector3) -> tuple[float, float, float]:
        """Latitude and longitude in degrees, altitude in metres."""
        north, east, down = position_ned_m
        lat0 = math.radians(self.latitude_deg)
        distance = math.hypot(north, east)
        angle = distance / EARTH_RADIUS_M
        if distance == 0.0:
            return self.latitude_deg, self.longitude_deg, self.altitude_m - down
        sin, cos = math.sin(angle), math.cos(angle)
        lat = math.asin(cos * math.sin(lat0) + north * sin * math.cos(lat0) / distance)
        turn = math.atan2(east * sin, distance * math.cos(lat0) * cos - north * math.sin(lat0) * sin)
        return math.degrees(lat), self.longitude_deg + math.degrees(turn), self.altitude_m - down
