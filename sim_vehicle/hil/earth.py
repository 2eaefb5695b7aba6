"""The Earth under the simulated world: where its origin lies, its magnetic field and its air."""

import math

import numpy as np

from sim_vehicle.hil.messages import Air, Place
from sim_vehicle.world import Vector3

# Where PX4's own simulators put their home by default, so that its users know the place.
HOME = Place(latitude_deg=47.397742, longitude_deg=8.545594, altitude_m=488.0)
# Inside the five years of WMM2025; fixed, so that the same flight has the same field.
FIELD_YEAR = 2026.0
_FIELD_MODEL = "wmm/WMM_2025.COF"

# The sphere of PX4's projection between geographic and local coordinates (lib/geo).
EARTH_RADIUS_M = 6_371_000.0
_NANOTESLA_PER_GAUSS = 1e5
_PASCAL_PER_HECTOPASCAL = 100.0
_KELVIN_AT_0_C = 273.15

# The table of air reaches as far as any scene; metres above home. Linear interpolation over one metre
# is wrong by 0.0002 Pa, a fiftieth of a millimetre.
_LOWEST_M, _HIGHEST_M = -200, 2000


def place_at(position_ned_m: Vector3, home: Place = HOME) -> Place:
    """A local position on the Earth.

    Meridians are taken as parallel: 100 m from home that is wrong by 1 mm, a tenth of HIL_GPS's resolution.
    """
    north_m, east_m, down_m = position_ned_m
    parallel_radius_m = EARTH_RADIUS_M * math.cos(math.radians(home.latitude_deg))
    return Place(
        home.latitude_deg + math.degrees(north_m / EARTH_RADIUS_M),
        home.longitude_deg + math.degrees(east_m / parallel_radius_m),
        home.altitude_m - down_m,
    )


def magnetic_field_ned_gauss(home: Place = HOME, year: float = FIELD_YEAR) -> Vector3:
    """The World Magnetic Model's field, the same all over a scene."""
    # Here, as below: only a vehicle that is simulated needs it.
    from pygeomag import GeoMag

    field = GeoMag(coefficients_file=_FIELD_MODEL).calculate(
        glat=home.latitude_deg, glon=home.longitude_deg, alt=home.altitude_m / 1000, time=year
    )
    return field.x / _NANOTESLA_PER_GAUSS, field.y / _NANOTESLA_PER_GAUSS, field.z / _NANOTESLA_PER_GAUSS


class StandardAir:
    """Pressure and temperature of the ICAO standard atmosphere near home."""

    def __init__(self, home: Place = HOME) -> None:
        # Here, because it brings scipy's optimizers, which take half a second to load.
        from ambiance import Atmosphere

        self._home_altitude_m = home.altitude_m
        heights_m = home.altitude_m + np.arange(_LOWEST_M, _HIGHEST_M + 1)
        atmosphere = Atmosphere(heights_m)
        self._pressure_pa: list[float] = atmosphere.pressure.tolist()
        self._temperature_k: list[float] = atmosphere.temperature.tolist()

    def at(self, height_m: float, pressure_noise_pa: float = 0.0) -> Air:
        """The air ``height_m`` above home; beyond the table the nearest that it has."""
        steps = min(max(height_m, _LOWEST_M), _HIGHEST_M - 1e-6) - _LOWEST_M
        index = int(steps)
        share = steps - index
        pressure_pa = self._pressure_pa[index] * (1 - share) + self._pressure_pa[index + 1] * share
        return Air(
            pressure_hpa=(pressure_pa + pressure_noise_pa) / _PASCAL_PER_HECTOPASCAL,
            altitude_m=self._home_altitude_m + height_m,
            temperature_c=self._temperature_k[index] - _KELVIN_AT_0_C,
        )
