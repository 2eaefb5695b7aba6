"""The Earth under the simulated world: where its origin lies, its magnetic field and its air."""

from sim_vehicle.geography import HOME, Place
from sim_vehicle.hil.messages import Air
from sim_vehicle.quantities import Vector3

# Inside the five years of WMM2025; fixed, so that the same flight has the same field.
FIELD_YEAR = 2026.0
_FIELD_MODEL = "wmm/WMM_2025.COF"

_NANOTESLA_PER_GAUSS = 1e5
_SEA_LEVEL_PA, _SEA_LEVEL_K, _LAPSE_K_M = 101_325.0, 288.15, 0.0065
# Gravity over the lapse rate and the gas constant of air.
_EXPONENT = 9.80665 / (287.0528 * _LAPSE_K_M)


def magnetic_field_ned_gauss(home: Place = HOME) -> Vector3:
    """The World Magnetic Model's field, the same all over a scene."""
    # Here: only a vehicle that is simulated needs it.
    from pygeomag import GeoMag

    field = GeoMag(coefficients_file=_FIELD_MODEL).calculate(
        glat=home.latitude_deg, glon=home.longitude_deg, alt=home.altitude_m / 1000, time=FIELD_YEAR
    )
    return field.x / _NANOTESLA_PER_GAUSS, field.y / _NANOTESLA_PER_GAUSS, field.z / _NANOTESLA_PER_GAUSS


def air_at(altitude_m: float, noise_pa: float = 0.0) -> Air:
    """The ICAO standard atmosphere of the lowest eleven kilometres, by its formula (PX4's lib/atmosphere)."""
    share = 1 - _LAPSE_K_M * altitude_m / _SEA_LEVEL_K
    pressure_pa = _SEA_LEVEL_PA * share**_EXPONENT + noise_pa
    shown_m = _SEA_LEVEL_K / _LAPSE_K_M * (1 - (pressure_pa / _SEA_LEVEL_PA) ** (1 / _EXPONENT))
    return Air(pressure_pa / 100, shown_m, _SEA_LEVEL_K * share - 273.15)
