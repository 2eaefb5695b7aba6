"""What a vehicle is: masses, lengths, springs, motors, sensors and gains, read from a YAML file."""

import difflib
import math
from collections.abc import Mapping
from functools import lru_cache
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from pydantic import AfterValidator, Field, ValidationError, model_validator

from sim_vehicle.airframes.aiding import Estimator, Sensors
from sim_vehicle.errors import AirframeError
from sim_vehicle.written import NotNegative, Part, Positive

# What the records of the kernels have room for, and an octorotor needs.
MOST_ROTORS = 8
# An airframe file gives places to a tenth of a millimetre.
PLACED_M = 1e-3
# Of all thrust, PX4's MPC_THR_MIN: with what a vehicle that is asked to fall still steers.
THRUST_MIN = 0.12
# Of all thrust, what hovering takes at least: a fifth of the weight is left to sink and to brake a climb with.
LEAST_HOVER = 1.25 * THRUST_MIN
# Above this share of the way from MPC_THR_MIN to hover's thrust PX4 takes no vehicle for landed
# (MulticopterLandDetector.cpp).
NO_THRUST_SHARE = 0.1
# Damping ratio of the closed loops, at least: half of what the built-in airframes have. A swing leaves a quarter of
# itself to the next one.
LEAST_DAMPING = 0.2
BUILT_IN_FOLDER = Path(__file__).parent / "airframes"

Fraction = Annotated[float, Field(gt=0, lt=1)]
# It is a comment in files that a shell reads: what came after a line's end would be a command.
OneLine = Annotated[str, AfterValidator(lambda text: " ".join(text.split()))]


class Geometry(Part):
    """Lengths in metres, in the body's horizontal plane unless said otherwise."""

    hub_radius_m: Positive
    """Where the arms begin. The hub is also a solid sphere of `hub_solid_radius_m`."""
    arm_length_m: Positive
    """The paper's l_arm: from the hub's edge to the motor's axis."""
    guard_radius_m: Positive
    """Radius of the propeller guard's disc around the motor's axis: the contact point lies on its rim."""
    guard_height_m: NotNegative
    """Height of the guard's hoop, half above and half below the arms' plane."""
    hub_solid_radius_m: Positive
    """Of the solid sphere in the middle."""
    foot_radius_m: Positive
    """Distance of each of the four feet from the centre, under the arms."""
    foot_depth_m: Positive
    """Depth of the feet below the centre of mass."""

    @property
    def motor_radius_m(self) -> float:
        """Centre of mass to motor axis: half of the paper's 290 mm."""
        return self.hub_radius_m + self.arm_length_m

    @property
    def reach_m(self) -> float:
        """The furthest any part is from the centre."""
        foot_m = math.hypot(self.foot_radius_m, self.foot_depth_m)
        return max(self.motor_radius_m + self.guard_radius_m, foot_m, self.hub_solid_radius_m)


class Rotor(Part):
    """One rotor with its arm, along the line from the centre, and its guard."""

    place_frd_m: tuple[float, float]
    """Of its axis: ahead of the centre of mass, and to the right."""
    direction: Literal["ccw", "cw"]
    """How it turns, seen from above."""
    spring: bool = True
    """Whether its arm folds as `arms` says."""


class Bounce(Part):
    """A linear spring and damper stated by what it does when a mass lands on it."""

    contact_time_s: Positive
    """From first touch until the force is back at zero."""
    restitution: Fraction
    """Speed after over speed before; for a linear spring and damper the same at every speed."""


class Arms(Part):
    """The folding arms of eq. 2; `fold_max_m` = 0 makes the vehicle rigid."""

    damping_per_s: NotNegative
    """b_s, normalised by the mass of the whole vehicle."""
    stiffness_per_s2: NotNegative
    """k_s, normalised by the mass of the whole vehicle."""
    fold_max_m: NotNegative
    """l_max: where the arm meets its stop."""
    hysteresis_m: NotNegative
    """delta l: the fold that stays after a hit."""
    tip_mass_kg: NotNegative
    """What moves at the end of each arm: motor, propeller, guard, outer arm. Part of `mass_kg`; it makes J(l)."""
    stop: Bounce
    """The stop at l_max (for a rigid vehicle: the frame itself), for half of the vehicle's mass."""


class Motors(Part):
    max_thrust_n: Positive
    """Of one motor with its propeller."""
    idle_fraction: NotNegative
    """Thrust of an armed, idling motor as a fraction of the maximum."""
    time_constant_s: Positive
    """Of the first-order lag from command to thrust."""
    moment_per_thrust_m: Positive
    """Reaction torque about the rotor's axis per newton of thrust."""


class Surface(Part):
    guard_friction: NotNegative
    """Coulomb coefficient between a guard and a wall."""
    ground_friction: NotNegative
    """Coulomb coefficient between a foot and the ground."""
    foot: Bounce
    """One foot on the ground, for a quarter of the vehicle's mass."""


SensorOffset = Annotated[float, Field(ge=-0.15, le=0.15)]


class Imu(Part):
    raw_interval_us: Annotated[int, Field(gt=0)]
    """Between two raw samples."""
    integration_interval_us: Annotated[int, Field(gt=0)]
    """Averaging interval of one HIGHRES_IMU sample (PX4: 1e6 / IMU_INTEG_RATE)."""
    above_centre_m: SensorOffset = 0.0
    """Height of the sensor above the centre of mass. The vehicle is not told (EKF2_IMU_POS_Z is 0)."""
    ahead_of_centre_m: SensorOffset = 0.0
    """And ahead of it."""
    right_of_centre_m: SensorOffset = 0.0
    """And to its right."""
    accelerometer_range_m_s2: Positive
    """Raw samples are clipped here, per axis."""
    accelerometer_noise_m_s2: NotNegative
    """Standard deviation of the *mean* over one integration interval: sensor noise and vibration."""
    accelerometer_bias_m_s2: NotNegative
    """Standard deviation of the constant error that is drawn for each flight, per axis."""
    gyroscope_noise_rad_s: NotNegative
    """As `accelerometer_noise_m_s2`, of the angular rate."""
    gyroscope_bias_rad_s: NotNegative
    """As `accelerometer_bias_m_s2`, of the angular rate."""

    @property
    def place_frd_m(self) -> tuple[float, float, float]:
        """Of the sensor, from the centre of mass."""
        return (self.ahead_of_centre_m, self.right_of_centre_m, -self.above_centre_m)

    @model_validator(mode="after")
    def _whole_samples(self) -> "Imu":
        if self.integration_interval_us % self.raw_interval_us:
            raise ValueError("integration_interval_us must be a whole multiple of raw_interval_us")
        return self


class Clipping(Part):
    """How an estimate finds back after a hit of which an accelerometer's clipping hid a part (bench/notes/px4.md).

    The hidden part is missing in the velocity at once. `late_s` later the error of the place that grows from it begins
    to correct both. A part is taken for a tilt: the attitude is off by as much, and goes back slowly.
    """

    late_s: NotNegative
    """Until the correction begins."""
    frequency_rad_s: Positive
    """Natural frequency of the correction."""
    damping: Positive
    """Its damping ratio."""
    tilt_per_s: NotNegative = 0.0
    """How fast the tilt goes back. 0: nothing is taken for a tilt."""


class Estimate(Part):
    """Where the vehicle's own state estimate comes from.

    `markov`: the truth, late, with errors that are first-order Gauss-Markov processes per axis, which the figures
    here describe. `ekf`: a Kalman filter over the sensors, which `sensors` and `estimator` describe.
    """

    kind: Literal["markov", "ekf"]
    """`markov` or `ekf`."""
    delay_s: NotNegative
    """Age of position and velocity when they are used."""
    position_noise_m: NotNegative
    """Standard deviation per axis."""
    position_correlation_s: Positive
    """Time constant of that error."""
    velocity_noise_m_s: NotNegative
    """Standard deviation per axis."""
    velocity_correlation_s: Positive
    """Time constant of that error."""
    attitude_noise_rad: NotNegative
    """Standard deviation per axis."""
    attitude_correlation_s: Positive
    """Time constant of that error."""
    clipping: Clipping | None
    """None: the estimate knows all of a hit, whatever the accelerometer saw of it."""


class Control(Part):
    """Gains of eqs. 4-6. Attitude gains are stated as the closed loop's frequency and damping."""

    position_p_per_s: Positive
    """Eq. 6, k_p; PX4's MPC_XY_P."""
    velocity_p_per_s: Positive
    """Eq. 6, k_v."""
    velocity_i_per_s2: NotNegative
    """Eq. 6, k_vI."""
    velocity_d: NotNegative
    """Eq. 6, k_vD."""
    climb_p_per_s: Positive | None = None
    """Of the velocity along z; None: as sideways. A vehicle that leans slowly climbs as fast as any."""
    climb_i_per_s2: NotNegative | None = None
    """The same of the integral."""
    attitude_frequency_rad_s: Positive
    """Natural frequency of roll and pitch: k_R is J times its square."""
    attitude_damping: Positive
    """Damping ratio of all three axes: k_Omega is 2 J times both."""
    yaw_frequency_rad_s: Positive
    """Natural frequency of yaw."""
    tilt_max_rad: Positive
    """Of the commanded attitude."""
    speed_max_m_s: Positive
    """Horizontal; PX4's MPC_XY_VEL_MAX."""
    climb_max_m_s: Positive
    """PX4's MPC_Z_VEL_MAX_UP."""
    descent_max_m_s: Positive
    """PX4's MPC_Z_VEL_MAX_DN."""

    @property
    def climb_gains(self) -> tuple[float, float]:
        """Of the velocity along z and of its integral."""
        p_per_s, i_per_s2 = self.climb_p_per_s, self.climb_i_per_s2
        return p_per_s or self.velocity_p_per_s, self.velocity_i_per_s2 if i_per_s2 is None else i_per_s2


class Airframe(Part):
    """One vehicle. Frames: body forward-right-down; arms in PX4's motor order."""

    name: OneLine
    """Names the airframe in summaries."""
    description: OneLine
    """A line for people."""
    mass_kg: Positive
    """Of the whole vehicle."""
    inertia_kg_m2: tuple[Positive, Positive, Positive]
    """About body x, y, z, arms out."""
    drag_n_s_m: NotNegative
    """Linear drag of the whole vehicle, the same in every direction."""
    geometry: Geometry
    rotors: Annotated[tuple[Rotor, ...], Field(exclude_if=lambda rotors: not rotors)] = ()
    """4, 6 or 8, in the order of PX4's motor outputs. None: a quad-x of four equal arms."""
    arms: Arms
    motors: Motors
    surface: Surface
    imu: Imu
    estimate: Estimate
    sensors: Sensors
    estimator: Estimator
    control: Control

    @property
    def weight_n(self) -> float:
        return self.mass_kg * 9.81

    @property
    def rotor_count(self) -> int:
        return len(self.rotors) or 4

    @property
    def most_thrust_n(self) -> float:
        """Of all motors."""
        return self.rotor_count * self.motors.max_thrust_n

    @property
    def hover_fraction(self) -> float:
        """Thrust to hover over the greatest thrust."""
        return self.weight_n / self.most_thrust_n

    @model_validator(mode="after")
    def _can_navigate(self) -> "Airframe":
        if self.estimate.kind == "ekf" and not self.sensors.can_navigate:
            raise ValueError(
                "estimate.kind ekf needs fitted sensors: optical_flow, range_finder and compass, or motion_capture"
            )
        return self

    @model_validator(mode="after")
    def _is_a_multicopter(self) -> "Airframe":
        if not self.rotors:
            return self
        places_m = [rotor.place_frd_m for rotor in self.rotors]
        if len(places_m) not in (4, 6, MOST_ROTORS):
            raise ValueError(f"rotors: {len(places_m)} of them; give 4, 6 or {MOST_ROTORS}")
        off_m = max(abs(sum(along)) / len(places_m) for along in zip(*places_m, strict=True))
        if off_m > PLACED_M:
            raise ValueError(
                f"rotors: their middle is {off_m:.3f} m from the centre of mass; "
                "without tilt the vehicle hovers only if they lie evenly around it"
            )
        if 2 * sum(rotor.direction == "cw" for rotor in self.rotors) != len(self.rotors):
            raise ValueError("rotors: let half of them turn cw and half ccw, else the vehicle turns about itself")
        made = [(*rotor.place_frd_m, 1.0 if rotor.direction == "ccw" else -1.0) for rotor in self.rotors]
        if np.linalg.matrix_rank(np.array(made), tol=PLACED_M) < 3:
            raise ValueError("rotors: placed and turning so, they cannot roll, pitch and yaw the vehicle one by one")
        furthest_m, said_m = max(math.hypot(*place) for place in places_m), self.geometry.motor_radius_m
        if abs(furthest_m - said_m) > PLACED_M:
            raise ValueError(
                f"rotors: the furthest is {furthest_m:.3f} m from the centre, geometry.hub_radius_m and arm_length_m "
                f"say {said_m:.3f} m; make them agree"
            )
        nearest_m = min(math.dist(one, other) for one, other in combinations(places_m, 2))
        if nearest_m < 2 * self.geometry.guard_radius_m:
            raise ValueError(
                f"rotors: two are {nearest_m:.3f} m apart, their guards would overlap; "
                f"make geometry.guard_radius_m {nearest_m / 2:.3f} or less"
            )
        return self

    @model_validator(mode="after")
    def _is_a_body(self) -> "Airframe":
        x, y, z = self.inertia_kg_m2
        # A flat body has as much about one axis as about the two others; files give three digits.
        if 2.0 * max(x, y, z) > 1.01 * (x + y + z):
            raise ValueError("inertia_kg_m2: one is more than the two others together, which no body has")
        tip_kg, radius_m = self.arms.tip_mass_kg, self.geometry.motor_radius_m
        squares_m2 = [math.hypot(*rotor.place_frd_m) ** 2 for rotor in self.rotors] or 4 * [radius_m**2]
        if tip_kg * len(squares_m2) >= self.mass_kg or tip_kg * sum(squares_m2) >= z:
            raise ValueError(
                f"arms.tip_mass_kg: {len(squares_m2)} ends of {tip_kg:g} kg have more mass, or more moment of inertia "
                "about z, than the whole vehicle; lower it"
            )
        return self

    @model_validator(mode="after")
    def _holds_its_place(self) -> "Airframe":
        gains = self.control
        for what, frequency_rad_s in (
            ("roll and pitch", gains.attitude_frequency_rad_s),
            ("yaw", gains.yaw_frequency_rad_s),
        ):
            if _damping(self._turning(frequency_rad_s)) < LEAST_DAMPING:
                raise ValueError(
                    f"control: the motors' lag lets {what} swing; lower its frequency_rad_s or motors.time_constant_s"
                )
        level = self._turning(gains.attitude_frequency_rad_s), gains.velocity_p_per_s, gains.velocity_i_per_s2
        climb = [self.motors.time_constant_s, 1.0], *gains.climb_gains
        for way, (lag, p_per_s, i_per_s2) in (("sideways", level), ("in height", climb)):
            # a = (p + i / s) (k (x_d - x) - s x) - d s^2 x, through the lag and the estimate's delay
            asked = lag[-1] * np.polymul([p_per_s, i_per_s2], [1.0, gains.position_p_per_s])
            braked = np.polyadd([lag[-1] * gains.velocity_d, 0.0, 0.0, 0.0], asked)
            moved = np.polymul(np.polymul(lag, [self.estimate.delay_s, 1.0]), [1.0, 0.0, 0.0, 0.0])
            if _damping(np.polyadd(moved, braked)) < LEAST_DAMPING:
                raise ValueError(
                    f"control: place, velocity and attitude swing each other up {way}; lower control.position_p_per_s, "
                    "velocity_p_per_s or velocity_i_per_s2, or raise attitude_frequency_rad_s"
                )
        return self

    def _turning(self, frequency_rad_s: float) -> list[float]:
        """The characteristic polynomial of a loop of the attitude, through the motors' lag; its end is the gain."""
        turned = 2.0 * self.control.attitude_damping * frequency_rad_s
        return [self.motors.time_constant_s, 1.0, turned, frequency_rad_s**2]

    @model_validator(mode="after")
    def _can_fly(self) -> "Airframe":
        if self.hover_fraction > 0.9:
            raise ValueError(
                f"hovering would take {100 * self.hover_fraction:.0f} % of the greatest thrust; "
                "raise motors.max_thrust_n or lower mass_kg so that it takes at most 90 %"
            )
        if self.hover_fraction < LEAST_HOVER:
            raise ValueError(
                f"hovering would take {100 * self.hover_fraction:.1f} % of the greatest thrust, and PX4 asks for no "
                f"less than {100 * THRUST_MIN:.0f} %: the vehicle could not sink; "
                f"lower motors.max_thrust_n so that it takes at least {100 * LEAST_HOVER:.0f} %"
            )
        most_idle = THRUST_MIN + NO_THRUST_SHARE * max(0.0, self.hover_fraction - THRUST_MIN)
        if self.motors.idle_fraction > most_idle:
            raise ValueError(
                f"motors that idle at {100 * self.motors.idle_fraction:.0f} % of their thrust keep PX4 from seeing a "
                f"landing; lower motors.idle_fraction to {math.floor(100 * most_idle) / 100:g} or less"
            )
        return self

    @model_validator(mode="after")
    def _stands_on_its_feet(self) -> "Airframe":
        frame = self.geometry
        depths_m = {
            "the hub, geometry.hub_solid_radius_m": frame.hub_solid_radius_m,
            "the guards, half of geometry.guard_height_m": frame.guard_height_m / 2,
        }
        for part, depth_m in depths_m.items():
            if depth_m >= frame.foot_depth_m:
                raise ValueError(
                    f"{part}, reaches {depth_m:g} m below the centre and the feet reach {frame.foot_depth_m:g} m: "
                    "it would begin in the ground; make it smaller or raise geometry.foot_depth_m"
                )
        return self


def _damping(polynomial: Any) -> float:
    """Of the least damped of its roots."""
    return float(min(-root.real / abs(root) for root in np.roots(np.trim_zeros(polynomial))))


def built_in_airframes() -> tuple[str, ...]:
    """Names of the airframes that come with the package."""
    return tuple(sorted(path.stem for path in BUILT_IN_FOLDER.glob("*.yaml")))


@lru_cache
def load_built_in(name: str) -> Airframe:
    """The airframe of that name; raises AirframeError where there is none."""
    if name not in built_in_airframes():
        near = difflib.get_close_matches(name, built_in_airframes(), n=1)
        meant = f"did you mean {near[0]}? There are" if near else "use one of"
        raise AirframeError(
            f"no airframe is called '{name}': {meant} {', '.join(built_in_airframes())} or a file's path"
        )
    data = yaml.safe_load((BUILT_IN_FOLDER / f"{name}.yaml").read_text())
    return Airframe.model_validate(with_base(data))


def load_airframe(name: str) -> Airframe:
    """A built-in one, or that of a file; raises AirframeError where there is none."""
    if not name.endswith((".yaml", ".yml")):
        return load_built_in(name)
    try:
        return Airframe.model_validate(with_base(yaml.safe_load(Path(name).read_text())))
    except ValidationError as problem:
        first = problem.errors()[0]
        raise AirframeError(f"{name}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from problem
    except (OSError, TypeError, ValueError, yaml.YAMLError) as problem:
        raise AirframeError(f"{name} cannot be read as an airframe: {problem}") from problem


def with_base(data: Mapping[str, Any]) -> dict[str, Any]:
    """``data`` of an airframe file laid over the built-in airframe that its `based_on` names, if any."""
    own = dict(data)
    base = own.pop("based_on", None)
    if base is None:
        return own
    return _laid_over(load_built_in(str(base)).model_dump(), own)


def _laid_over(below: dict[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(below)
    for key, value in above.items():
        lower = merged.get(key)
        merged[key] = _laid_over(lower, value) if isinstance(lower, dict) and isinstance(value, dict) else value
    return merged
