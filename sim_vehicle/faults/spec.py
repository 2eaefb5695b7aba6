"""The entries of `sim.faults`: what goes wrong, how much, and when by the vehicle's boot clock."""

from itertools import combinations
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from sim_vehicle.airframe import MOST_ROTORS
from sim_vehicle.errors import FaultError
from sim_vehicle.obstacles import Point
from sim_vehicle.written import Finite, NotNegative, Part, Positive

Share = Annotated[float, Field(ge=0, le=1)]
Motor = Annotated[int, Field(ge=0, lt=MOST_ROTORS)]

FOREVER_S = 1e9


class Timed(Part):
    """When a fault acts: from a moment on, or between two."""

    at_s: NotNegative | None = None
    """From then on, or the moment of what happens once; seconds of the vehicle's boot clock."""
    between_s: tuple[NotNegative, NotNegative] | None = None
    """[from, until], by the same clock."""

    @model_validator(mode="after")
    def _has_one_time(self) -> Self:
        if (self.at_s is None) == (self.between_s is None):
            raise ValueError("give at_s (from then on) or between_s: [from, until], and not both")
        if self.between_s is not None and self.between_s[1] <= self.between_s[0]:
            raise ValueError(f"between_s: [{self.between_s[0]:g}, {self.between_s[1]:g}] ends before it begins")
        return self

    @property
    def window_s(self) -> tuple[float, float]:
        """From when until when."""
        return self.between_s or (self.at_s or 0.0, FOREVER_S)


class During(Timed):
    """A fault that has to end: `between_s` only."""

    @model_validator(mode="after")
    def _ends(self) -> Self:
        if self.between_s is None:
            raise ValueError("give between_s: [from, until]")
        return self


class Moment(Timed):
    """A fault that happens once: `at_s` only."""

    @model_validator(mode="after")
    def _happens(self) -> Self:
        if self.at_s is None:
            raise ValueError("give at_s, the moment when it happens")
        return self


class Gust(During):
    """Extra wind that rises, stays and falls as half a cosine (the discrete gust of MIL-F-8785C)."""

    kind: Literal["gust"]
    velocity_ned_m_s: Point
    """Of the extra wind: the direction it blows to."""
    rise_s: Positive = 0.5
    """How long it rises, and how long it falls."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        start_s, end_s = self.window_s
        if 2 * self.rise_s > end_s - start_s:
            raise ValueError(f"a gust of {end_s - start_s:g} s has no room to rise and fall in {self.rise_s:g} s each")
        return self


class Turbulence(Timed):
    """Continuous gusts near the ground: Dryden's spectra with MIL-F-8785C's low-altitude lengths and strengths."""

    kind: Literal["turbulence"]
    wind_20ft_m_s: NotNegative
    """Wind speed at 20 ft: 7.7 m/s (15 knots) is light turbulence there, 15.4 moderate, 23.1 severe."""


class MotorFailure(Timed):
    """A motor gives less than it is commanded: a broken propeller, a failing speed controller."""

    kind: Literal["motor_failure"]
    motor: Motor
    """In the airframe's order: of a quad-x 0 front right, 1 rear left, 2 front left, 3 rear right."""
    thrust_share: Share = 0.0
    """Share of the commanded thrust that is left."""


class FreeFall(Timed):
    """All motors stop."""

    kind: Literal["free_fall"]


class BatterySag(During):
    """The supply falls in a straight line and stays low; thrust goes with its square."""

    kind: Literal["battery_sag"]
    voltage_share: Annotated[float, Field(gt=0, le=1)]
    """Share of the voltage that is left at the end."""


class PayloadDrop(Moment):
    """A load at the centre of mass, of which the control knows nothing, until it is let go."""

    kind: Literal["payload_drop"]
    mass_kg: Positive
    """Of the load."""


class Vibration(Timed):
    """Rotors that are not balanced, as the raw samples of the inertial sensor see them."""

    kind: Literal["vibration"]
    accelerometer_rms_m_s2: NotNegative
    """On each axis at hover thrust; goes with thrust."""
    gyroscope_rms_rad_s: NotNegative = 0.0
    """The same of the gyroscope."""
    motor: Motor | None = None
    """The rotor that is bent; without it all share it."""
    motor_hz: Annotated[float, Field(gt=0, le=1000)] = 180.0
    """Turns a second at hover thrust; goes with its root. A 6-inch propeller that lifts 280 g turns about so fast."""


class Push(During):
    """A steady force on a point of the body: a hand, a rope, a downdraught."""

    kind: Literal["push"]
    force_ned_n: Point
    """The full force."""
    point_frd_m: Point = (0.0, 0.0, 0.0)
    """Where it acts; the centre of mass by default."""
    rise_s: NotNegative = 0.05
    """To full force and back, as half a cosine."""


class ImuBias(Timed):
    """The inertial sensor's zero moves."""

    kind: Literal["imu_bias"]
    accelerometer_frd_m_s2: Point = (0.0, 0.0, 0.0)
    """Added to the specific force."""
    gyroscope_frd_rad_s: Point = (0.0, 0.0, 0.0)
    """Added to the angular rate."""


class ImuStuck(Timed):
    """One raw axis shows the same value all the time: the one it showed last, or a given one."""

    kind: Literal["imu_stuck"]
    axis: Literal["accelerometer_x", "accelerometer_y", "accelerometer_z", "gyroscope_x", "gyroscope_y", "gyroscope_z"]
    """Which one."""
    value: Finite | None = None
    """m/s2 or rad/s."""


class EstimatorReset(Moment):
    """The estimate jumps and says so: the reset counter goes up."""

    kind: Literal["estimator_reset"]
    position_jump_ned_m: Point = (0.0, 0.0, 0.0)
    """Stays: the vehicle flies on in a frame that has moved."""
    velocity_jump_ned_m_s: Point = (0.0, 0.0, 0.0)
    """Fades within `settles_s`."""
    settles_s: Positive = 1.0
    """Time constant with which the velocity finds back to the truth."""


class EstimatorAfterClipping(Timed):
    """After a hit that the accelerometer clipped the estimated velocity resets again and again.

    PX4 after a hit of 108 m/s2 changed its primary estimator four times in 36 ms (a log of v1.12 on an FMU v5).
    """

    kind: Literal["estimator_after_clipping"]
    resets: Annotated[int, Field(ge=0, le=20)] = 4
    """How many."""
    over_s: Positive = 0.036
    """Within how long."""
    kick_m_s: NotNegative = 0.3
    """Standard deviation, per axis, of what each reset leaves instead of the error before."""
    settles_s: Positive = 0.5
    """Time constant with which the last error fades."""
    least_hidden_m_s: NotNegative = 0.02
    """Less than this hidden in an interval disturbs nobody: a propeller that clips now and then."""


class AidingLoss(Timed):
    """The GPS is lost: the estimate drifts until it is back."""

    kind: Literal["aiding_loss"]
    sensor: Literal["gps"]
    """What is lost."""
    drift_m_s2: NotNegative = 0.1
    """Velocity gone astray per root second, for an estimate of kind markov; half a degree of tilt is 0.09 m/s2."""


class WireFault(Timed):
    """What happens to packets between the vehicle and whoever listens; shares are chances per packet."""

    kind: Literal["wire"]
    direction: Literal["to_companion", "to_vehicle", "both"] = "both"
    """Of the packets."""
    messages: tuple[int | str, ...] = ()
    """Names or numbers of the messages that are hit; none named means all."""
    loss: Share = 0.0
    """1 cuts the link."""
    burst_packets: Annotated[float, Field(ge=1)] = 1.0
    """Mean length of a run of lost packets (Gilbert's two-state channel)."""
    delay_s: NotNegative = 0.0
    """Every packet is so late."""
    jitter_s: NotNegative = 0.0
    """Largest extra delay, uniformly distributed; the order stays."""
    reorder: Share = 0.0
    """Share of packets that are overtaken."""
    reorder_by_s: Positive = 0.02
    """How long such a packet is held back."""
    duplicate: Share = 0.0
    """Share of packets that come twice."""
    corrupt: Share = 0.0
    """Share of packets of which one byte is changed."""

    @model_validator(mode="after")
    def _does_something(self) -> Self:
        if not any((self.loss, self.delay_s, self.jitter_s, self.reorder, self.duplicate, self.corrupt)):
            raise ValueError("give at least one of loss, delay_s, jitter_s, reorder, duplicate and corrupt")
        if self.loss == 1.0 and self.burst_packets > 1.0:
            raise ValueError("loss: 1 loses every packet; leave burst_packets out")
        return self


class ImuDropout(Timed):
    """The inertial sensor's samples do not come: HIGHRES_IMU, SCALED_IMU and RAW_IMU are not sent."""

    kind: Literal["imu_dropout"]


class ClockJump(Moment):
    """All time stamps of the vehicle jump, and its answers to TIMESYNC with them."""

    kind: Literal["clock_jump"]
    jump_s: Finite
    """4294960 at 0 s puts the 32-bit milliseconds 7 s before their end."""


Fault = Annotated[
    Gust
    | Turbulence
    | MotorFailure
    | FreeFall
    | BatterySag
    | PayloadDrop
    | Vibration
    | Push
    | ImuBias
    | ImuStuck
    | ImuDropout
    | EstimatorReset
    | EstimatorAfterClipping
    | AidingLoss
    | WireFault
    | ClockJump,
    Field(discriminator="kind"),
]


def check_motor(fault: Fault, rotors: int) -> None:
    """Raise FaultError for a motor that a vehicle of so many rotors does not have."""
    motor = fault.motor if isinstance(fault, MotorFailure | Vibration) else None
    if motor is not None and motor >= rotors:
        raise FaultError(f"{fault.kind}: no motor {motor}; this vehicle's are 0 to {rotors - 1}.")


def overlapping(faults: tuple[Fault, ...]) -> str | None:
    """What is wrong with two faults that would act at once and cannot; None if nothing is."""
    for one, other in combinations(faults, 2):
        start_s, end_s = max(one.window_s[0], other.window_s[0]), min(one.window_s[1], other.window_s[1])
        if start_s < end_s and (remedy := _apart(one, other)):
            return f"two faults of kind {one.kind} act at {start_s:g} s; {remedy}"
    return None


def _apart(one: Fault, other: Fault) -> str | None:
    """The body has one place for a push, and its rotors one speed: how two become possible that act at once."""
    if isinstance(one, Vibration) and isinstance(other, Vibration) and one.motor_hz != other.motor_hz:
        return "give them the same motor_hz"
    are_pushes = isinstance(one, Push) and isinstance(other, Push)
    return "let one end before the next begins" if are_pushes else None
