"""The inertia J(l) of a vehicle whose arms fold, and how fast it changes.

The end of each arm (motor, propeller, guard, outer arm) is a point mass on the arm's line, at
hub radius + arm length - fold from the centre; everything else is rigid. The centre of mass is taken as fixed: two
arms folded fully move it by 2 mm.
"""

from sim_vehicle.physics.jit import inlined, njit
from sim_vehicle.physics.layout import Constants
from sim_vehicle.quantities import Floats

# Entries of an inertia: the body's axes are principal but for x and y, which one folded arm couples.
XX, YY, ZZ, XY = range(4)


@inlined
def inertia_of(fold_m: Floats, fold_rate_m_s: Floats, constants: Constants, inertia: Floats, rate: Floats) -> None:
    """Write J (kg m^2) and its rate (kg m^2/s) at these folds, entries XX, YY, ZZ, XY, body frame."""
    for entry in range(3):
        inertia[entry] = constants.inertia_kg_m2[entry]
        rate[entry] = 0.0
    inertia[XY], rate[XY] = 0.0, 0.0
    for arm in range(constants.rotors):
        if fold_m[arm] == 0.0 and fold_rate_m_s[arm] == 0.0:
            continue
        out, x, y = (
            constants.motor_radius_m[arm],
            constants.arm_direction_frd[arm, 0],
            constants.arm_direction_frd[arm, 1],
        )
        radius = out - fold_m[arm]
        gained = constants.tip_mass_kg * (radius * radius - out * out)
        gaining = -2.0 * constants.tip_mass_kg * radius * fold_rate_m_s[arm]
        for change, total in ((gained, inertia), (gaining, rate)):
            total[XX] += change * y * y
            total[YY] += change * x * x
            total[ZZ] += change
            total[XY] -= change * x * y


@inlined
def times(inertia: Floats, p: float, q: float, r: float) -> tuple[float, float, float]:
    """An inertia times a vector in the body frame."""
    return inertia[XX] * p + inertia[XY] * q, inertia[XY] * p + inertia[YY] * q, inertia[ZZ] * r


@njit
def turning_energy(inertia: Floats, p: float, q: float, r: float) -> float:
    """Kinetic energy of turning, joules."""
    x, y, z = times(inertia, p, q, r)
    return 0.5 * (p * x + q * y + r * z)
