"""What a step of the lockstep with a real PX4 costs, and what PX4 and the sockets cost at least, in one run.

The person starts PX4 as for a flight (docs/how-to/px4.md), with the parameters of the foldable vehicle. It stays on the
ground, disarmed. The least is measured by the same loop without a body: it sends samples of before again.
"""

import os
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from time import monotonic, perf_counter, process_time
from typing import Any

from bench.speed.parts import Function, Part, wrapped
from sim_vehicle.airframe import load_built_in
from sim_vehicle.hil.messages import Quadruple, ToPx4
from sim_vehicle.hil.vehicle import HilVehicle
from sim_vehicle.scene import Scene
from sim_vehicle.shell.hil_tcp import serve_px4

PARTS = (
    Part("body and sensors", "bench.speed.px4:Body.step"),
    Part("MAVLink out", "sim_vehicle.mavlink.hil:HilEncoder.packet"),
    Part("MAVLink in", "sim_vehicle.mavlink.hil:HilDecoder.push"),
)
# Until PX4 has booted and its estimator has settled; then each of the two is measured for so long.
_SETTLES_S, _MEASURED_S = 10.0, 10.0
# Samples that are sent again: PX4 takes a sensor for dead that says the same a hundred times.
_KEPT = 1000
_ALL = ("a step", "of a processor: this program", "of a processor: PX4")


class Body(HilVehicle):
    """The vehicle's, as long as it moves; then what it sensed last, again and again."""

    def __init__(self, interval_us: int) -> None:
        super().__init__(load_built_in("foldable"), Scene(), 1, interval_us)
        self._sensed: deque[Any] = deque(maxlen=_KEPT)
        self.moves = True

    def step(self, motor_fractions: Quadruple) -> tuple[ToPx4, ...]:
        if self.moves:
            messages = super().step(motor_fractions)
        else:
            self.time_boot_us += self.interval_us
            messages = (replace(self._sensed[0], time_us=self.time_boot_us),)
        self._sensed.append(messages[-1])
        return messages


def lockstep_table(port: int, rate_hz: int) -> Iterator[str]:
    """Lines, once a PX4 has come to the port and half a minute is over."""
    body = Body(1_000_000 // rate_hz)
    spent = {part.name: 0.0 for part in PARTS}
    began_s: list[float] = []
    marks: list[Sequence[float]] = []

    def new_vehicle() -> Body:
        began_s.append(monotonic())
        return body

    def is_over() -> bool:
        """Looked at before each step: where a part of the measurement begins or ends, the counts so far are noted."""
        due_s = _SETTLES_S + len(marks) * _MEASURED_S
        if began_s and monotonic() - began_s[0] >= due_s:
            steps = body.time_boot_us / body.interval_us
            marks.append((steps, perf_counter(), process_time(), _px4_s(), *spent.values()))
            body.moves = len(marks) < 2
        return len(marks) == 3

    def timed(part: Part, function: Function) -> Function:
        def call(*arguments: Any) -> Any:
            begun = perf_counter()
            result = function(*arguments)
            spent[part.name] += perf_counter() - begun
            return result

        return call

    with wrapped(timed, PARTS):
        serve_px4(new_vehicle, port, 0.0, stop=is_over)
    with_body, again = (
        [1e6 * (after - before) / (end[0] - start[0]) for before, after in zip(start, end, strict=True)][1:]
        for start, end in pairwise(marks)
    )
    rows = [*zip(_ALL, with_body, again, strict=False), *zip(spent, with_body[3:], again[3:], strict=True)]
    rest = (us[0] - sum(us[3:]) for us in (with_body, again))
    yield f"| µs of a step of {body.interval_us / 1e3:g} ms | with the body | samples sent again |"
    yield "|---|---:|---:|"
    for name, body_us, again_us in (*rows, ("PX4, sockets, loop", *rest)):
        yield f"| {name} | {body_us:.1f} | {again_us:.1f} |"
    yield f"| times real time | {body.interval_us / with_body[0]:.1f} | {body.interval_us / again[0]:.1f} |"


def _px4_s() -> float:
    """What every PX4 of this machine has had of its processors, in seconds."""
    ticks = 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        name, _, fields = path.read_text().partition(" (")[2].rpartition(") ")
        if name == "px4":
            ticks += sum(map(int, fields.split()[11:13]))
    return ticks / os.sysconf("SC_CLK_TCK")
