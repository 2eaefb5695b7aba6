"""All faults, in the order of `faults.yaml`, made anew for every flight as its chance has it."""

import math
import random
import signal
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from bench.faults import injectors
from bench.faults.injectors import CHANGES, Change, adding, forged, rewritten, setting, simulated
from bench.fly.air import Air, Expected, Fault, Injector, When
from bench.fly.packets import number_of
from sim_vehicle.bench.faults import FaultRequest, clock_jump, ekf_reset, other

Row = Mapping[str, Any]
_ARMED = 0x80


def _numbers(names: Sequence[str]) -> tuple[int, ...]:
    return tuple(map(number_of, names))


def _change(row: Row) -> Change:
    return setting(**row["set"]) if "set" in row else adding(**row["add"])


def _once(do: Callable[[Air], None], chance: random.Random, moment: str = "flying") -> Injector:
    return Injector(When.recovering(chance) if moment == "recovering" else When.flying(chance), do)


def _from_any_side(chance: random.Random) -> tuple[float, float]:
    """North and east."""
    side = chance.uniform(-math.pi, math.pi)
    return math.cos(side), math.sin(side)


def _reset(chance: random.Random, position_m: float, velocity_m_s: float) -> Injector:
    north, east = math.cos(chance.uniform(-math.pi, math.pi)), math.sin(chance.uniform(-math.pi, math.pi))
    jump, hop = ((size * north, size * east, 0.0) for size in (position_m, velocity_m_s))
    return simulated(ekf_reset(jump, hop), When.flying(chance))


def _gust(chance: random.Random) -> Injector:
    (north, east), speed = _from_any_side(chance), chance.uniform(4.0, 8.0)
    wind = (speed * north, speed * east, 0.0)
    return simulated(other("gust", velocity_ned_m_s=wind, rise_s=0.3), When.flying(chance, 2.0))


def _push(chance: random.Random) -> Injector:
    north, east = _from_any_side(chance)
    return simulated(other("push", force_ned_n=(2.0 * north, 2.0 * east, 0.0)), When.flying(chance, 0.5))


def _disarm(message: Any, air: Air) -> None:
    message.base_mode &= ~_ARMED


def _forged_velocity(chance: random.Random) -> Injector:
    """One packet, of ODOMETRY or of LOCAL_POSITION_NED, with a velocity 2 m/s aside."""
    axis, name = chance.choice(("vx", "vy", "vz")), chance.choice(("ODOMETRY", "LOCAL_POSITION_NED"))
    return forged(When.flying(chance), number_of(name), adding(**{axis: chance.choice((-2.0, 2.0))}))


def _forged_imu(names: Sequence[str], chance: random.Random, size: float, times: int = 1) -> Injector:
    when, axis = When.flying(chance), chance.choice(names)
    return forged(when, number_of("HIGHRES_IMU"), adding(**{axis: chance.choice((-size, size))}), times, 0.004)


# By the words after `do` in the file: what is drawn, in this order, belongs to the seed.
DOES: dict[str, Callable[..., Injector]] = {
    "stuck": lambda c, names, for_s=math.inf: injectors.stuck(When.flying(c, for_s), _numbers(names)),
    "thinned": lambda c, names, every: injectors.thinned(When.flying(c), _numbers(names), every),
    "jumped": lambda c, jump_s: Injector(When.flying(c), ahead_s=jump_s),
    "anew": lambda c: _once(lambda air: air.inject(clock_jump(-air.now_s)), c),
    "stalled": lambda c, seconds, moment="flying": _once(lambda air: setattr(air, "stall_s", seconds), c, moment),
    "signalled": lambda c, name, moment="flying": _once(
        lambda air: air.interrupts.on_signal(signal.Signals[name], None), c, moment
    ),
    "killed": partial(_once, Air.kill),
    "step_breaks": partial(_once, injectors.break_step),
    "memory_ends": partial(_once, lambda air: injectors.break_step(air, MemoryError())),
    "encoder_breaks": partial(_once, injectors.break_encoder),
    "reset": _reset,
    "height_reset": lambda c: simulated(ekf_reset((0.0, 0.0, c.choice((-0.5, 0.5)))), When.flying(c)),
    "gust": _gust,
    "push": _push,
    "forged_disarm": lambda c, *times: forged(When.flying(c), number_of("HEARTBEAT"), _disarm, *times),
    "forged_velocity": _forged_velocity,
    "forged_rate": partial(_forged_imu, ("xgyro", "ygyro")),
    "forged_force": partial(_forged_imu, ("xacc", "yacc")),
    "denied": lambda c: injectors.denied(When.flying(c)),
    "strangers": lambda c: injectors.strangers(When("connect", 2.0)),
    "flood": lambda c: injectors.strangers(When.flying(c, 3.0), 10),
    "foreign_byte": lambda c: injectors.noise(When("connect", 2.0), 1),
    "foreign_bytes": lambda c: injectors.noise(When.flying(c), 300),
    "taken": lambda c, state, from_s, within_s, stall_s=0.0, cut_s=0.0: injectors.taken(
        When(state, c.uniform(from_s, from_s + within_s)), stall_s, cut_s
    ),
}


def _injected(row: Row, chance: random.Random) -> Injector:
    if "do" in row:
        name, *arguments = row["do"]
        return DOES[name](chance, *arguments)
    for_s = row.get("for_s", math.inf)
    when = When(row["when"], for_s=for_s) if "when" in row else When.flying(chance, for_s)
    if "vehicle" in row:
        kind, *_ = row["vehicle"].values()
        return simulated(FaultRequest(kind, {k: v for k, v in row["vehicle"].items() if k != "kind"}), when)
    if "forge" in row:
        forge = row["forge"]
        return forged(
            when, number_of(forge["message"]), _change(forge), forge.get("times", 1), forge.get("every_s", 0.0)
        )
    rewrite = row["rewrite"]
    change = CHANGES[rewrite["by"]] if "by" in rewrite else _change(rewrite)
    return rewritten(when, _numbers(rewrite["messages"]), change)


def _read(file: Path) -> dict[str, tuple[Fault, ...]]:
    content = yaml.safe_load(file.read_text(encoding="utf-8"))
    expectations = {"lands": Expected()}
    for name, words in content["expectations"].items():
        expectations[name] = Expected(**{**words, "outcomes": tuple(words.get("outcomes", Expected().outcomes))})
    return {
        group: tuple(_fault(name, row, expectations) for name, row in rows.items())
        for group, rows in content["groups"].items()
    }


def _fault(name: str, row: Row, expectations: Mapping[str, Expected]) -> Fault:
    word = row.get("expected", "lands")
    return Fault(name, row["injected"], partial(_injected, row), expectations[word], word, from_the_start="when" in row)


GROUPS = _read(Path(__file__).with_name("faults.yaml"))
FLOWN = {fault.name: fault for faults in GROUPS.values() for fault in faults}
assert len(FLOWN) == sum(map(len, GROUPS.values())), "every fault has a name of its own"
