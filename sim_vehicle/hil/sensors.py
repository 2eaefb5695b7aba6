"""Sensors beside the inertial one, from the body's true state: magnetometer, barometer and GPS."""

import math
import random

from sim_vehicle.airframe import Airframe
from sim_vehicle.estimator.estimate import to_ned
from sim_vehicle.geography import HOME, Origin, Place
from sim_vehicle.hil.messages import Air, HilGps
from sim_vehicle.quantities import Quaternion, Vector3

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


# Rates usual on flight controllers; PX4 asks for no particular ones.
MAGNETOMETER_PERIOD_US = 20_000
BAROMETER_PERIOD_US = 20_000
GPS_PERIOD_US = 100_000

# Standard deviation of one sample. An IST8310's 3 mgauss at full rate, averaged down to 50 Hz.
MAGNETOMETER_NOISE_GAUSS = 0.001
# A BMP388 at its finest setting has 0.02 Pa, and a flying vehicle's own wind ten times that and more.
BAROMETER_NOISE_PA = 0.5


class Wander:
    """First-order Gauss-Markov error of one vector, as of a GPS fix."""

    def __init__(self, deviation: float, correlation_s: float, period_s: float, rng: random.Random) -> None:
        self._keep = math.exp(-period_s / correlation_s)
        self._kick = deviation * math.sqrt(1 - self._keep**2)
        self._rng = rng
        self._value = (rng.gauss(0, deviation), rng.gauss(0, deviation), rng.gauss(0, deviation))

    def next(self) -> Vector3:
        """The error one period later."""
        x, y, z = self._value
        keep, kick, gauss = self._keep, self._kick, self._rng.gauss
        self._value = (keep * x + gauss(0, kick), keep * y + gauss(0, kick), keep * z + gauss(0, kick))
        return self._value


class Magnetometer:
    """The world's field in the body's frame."""

    def __init__(self, rng: random.Random, home: Place = HOME) -> None:
        self._field_ned_gauss = magnetic_field_ned_gauss(home)
        self._rng = rng

    def sample(self, attitude_wxyz: Quaternion) -> Vector3:
        """In gauss, FRD."""
        x, y, z = to_body(attitude_wxyz, self._field_ned_gauss)
        gauss, noise = self._rng.gauss, MAGNETOMETER_NOISE_GAUSS
        return x + gauss(0, noise), y + gauss(0, noise), z + gauss(0, noise)


class Gps:
    """A receiver as good as the estimate that the airframe file states for the built-in autopilot.

    That is an RTK fix: with a plain receiver's metres, no difference between two flights would mean anything.
    """

    def __init__(self, airframe: Airframe, rng: random.Random, origin: Origin) -> None:
        self._origin = origin
        estimate, period_s = airframe.estimate, 1e-6 * GPS_PERIOD_US
        self._accuracy_m = estimate.position_noise_m
        self._position = Wander(estimate.position_noise_m, estimate.position_correlation_s, period_s, rng)
        self._velocity = Wander(estimate.velocity_noise_m_s, estimate.velocity_correlation_s, period_s, rng)

    def sample(self, time_us: int, position_ned_m: Vector3, velocity_ned_m_s: Vector3) -> HilGps:
        """A fix of the moment; a real receiver's is a tenth of a second late, and PX4's SITL assumes 10 ms."""
        return HilGps(
            time_us=time_us,
            place=self._origin.place_at(_sum(position_ned_m, self._position.next())),
            velocity_ned_m_s=_sum(velocity_ned_m_s, self._velocity.next()),
            accuracy_m=self._accuracy_m,
        )


def to_body(attitude_wxyz: Quaternion, vector_ned: Vector3) -> Vector3:
    """A NED vector in the body's FRD frame."""
    w, x, y, z = attitude_wxyz
    return to_ned((w, -x, -y, -z), vector_ned)


def _sum(a: Vector3, b: Vector3) -> Vector3:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
