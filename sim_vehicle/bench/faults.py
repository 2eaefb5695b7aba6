"""What can go wrong at run time, one function each; every other kind of a mission file's `sim.faults` by `other`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import TypeAdapter, ValidationError

from sim_vehicle.errors import FaultError
from sim_vehicle.faults.spec import ClockJump, EstimatorReset, Fault
from sim_vehicle.quantities import Vector3

Direction = Literal["to_companion", "to_vehicle", "both"]

_FAULT: TypeAdapter[Fault] = TypeAdapter(Fault)


@dataclass(frozen=True, slots=True)
class FaultRequest:
    """A fault without a time: `inject` gives it one."""

    kind: str
    settings: Mapping[str, Any]

    def timed(self, start_s: float, for_s: float | None) -> tuple[Fault, ...]:
        """The fault from a moment on; what happens once is undone after ``for_s`` by its opposite.

        Raises FaultError for settings that are wrong, and for a time that does not fit the kind.
        """
        if for_s is not None and for_s <= 0.0:
            raise FaultError(f"{self.kind}: for_s must be more than 0, not {for_s:g}.")
        if self.kind in _HAPPEN_ONCE:
            fault = self._made(at_s=start_s)
            if for_s is None:
                return (fault,)
            undone = opposite(fault, start_s + for_s)
            if undone is None:
                raise FaultError(f"{self.kind} cannot be undone: leave for_s out.")
            return fault, undone
        if for_s is None:
            if self.kind in _HAVE_TO_END:
                raise FaultError(f"{self.kind} has to end: say how long it lasts, e.g. inject(..., for_s=2).")
            return (self._made(at_s=start_s),)
        return (self._made(between_s=(start_s, start_s + for_s)),)

    def _made(self, **time: Any) -> Fault:
        try:
            return _FAULT.validate_python({"kind": self.kind, **self.settings, **time})
        except ValidationError as problem:
            first = problem.errors()[0]
            place = ".".join(str(part) for part in first["loc"] if part != self.kind)
            raise FaultError(f"{self.kind}{place and f', {place}'}: {first['msg']}.") from problem


def opposite(fault: Fault, at_s: float) -> Fault | None:
    """What undoes something that has happened; None where a fault ends by being taken away, or cannot be undone."""
    if isinstance(fault, ClockJump):
        return ClockJump(kind="clock_jump", at_s=at_s, jump_s=-fault.jump_s)
    if isinstance(fault, EstimatorReset):
        x, y, z = fault.position_jump_ned_m
        return EstimatorReset(kind="estimator_reset", at_s=at_s, position_jump_ned_m=(-x, -y, -z))
    return None


_HAPPEN_ONCE = ("clock_jump", "estimator_reset", "payload_drop")
_HAVE_TO_END = ("gust", "battery_sag", "push")


def sensor_dropout(sensor: Literal["imu", "gps"] = "imu") -> FaultRequest:
    """A sensor gives nothing. `imu`: no inertial message is sent; `gps`: as `gps_loss`."""
    return gps_loss() if sensor == "gps" else other(f"{sensor}_dropout")


def gps_loss(drift_m_s2: float = 0.1) -> FaultRequest:
    """No fix; ``drift_m_s2``: velocity that the estimate goes astray by per root second without one."""
    return other("aiding_loss", sensor="gps", drift_m_s2=drift_m_s2)


def packet_loss(
    share: float, burst_packets: float = 1.0, messages: tuple[int | str, ...] = (), direction: Direction = "both"
) -> FaultRequest:
    """That share of packets is lost, in runs of a mean length; ``messages`` by name or number, all by default."""
    return other("wire", loss=share, burst_packets=burst_packets, messages=messages, direction=direction)


def link_cut(direction: Direction = "both") -> FaultRequest:
    """Nothing gets through."""
    return other("wire", loss=1.0, direction=direction)


def delay(seconds: float, jitter_s: float = 0.0, direction: Direction = "both") -> FaultRequest:
    """Packets come later by this and up to ``jitter_s`` more; their order stays."""
    return other("wire", delay_s=seconds, jitter_s=jitter_s, direction=direction)


def reordering(share: float, by_s: float = 0.02, direction: Direction = "both") -> FaultRequest:
    """That share of packets is held back by ``by_s`` and overtaken."""
    return other("wire", reorder=share, reorder_by_s=by_s, direction=direction)


def duplication(share: float, direction: Direction = "both") -> FaultRequest:
    """That share of packets comes twice."""
    return other("wire", duplicate=share, direction=direction)


def corruption(share: float, direction: Direction = "both") -> FaultRequest:
    """Of that share of packets one byte is changed."""
    return other("wire", corrupt=share, direction=direction)


def clock_jump(seconds: float) -> FaultRequest:
    """Every time stamp of the vehicle jumps."""
    return other("clock_jump", jump_s=seconds)


def motor_failure(motor: int, thrust_share: float = 0.0) -> FaultRequest:
    """One motor gives that share of its thrust: 0 front right, 1 rear left, 2 front left, 3 rear right."""
    return other("motor_failure", motor=motor, thrust_share=thrust_share)


def ekf_reset(
    position_jump_ned_m: Vector3 = (0.0, 0.0, 0.0), velocity_jump_ned_m_s: Vector3 = (0.0, 0.0, 0.0)
) -> FaultRequest:
    """The estimate jumps and the reset counter goes up; the jump of the position stays."""
    return other(
        "estimator_reset", position_jump_ned_m=position_jump_ned_m, velocity_jump_ned_m_s=velocity_jump_ned_m_s
    )


def other(kind: str, **settings: Any) -> FaultRequest:
    """Any kind of docs/reference/world.md's table with its settings, without `at_s` and `between_s`."""
    return FaultRequest(kind, settings)
