"""The table of faults: its rows, what it flies, and what it calls a failure."""

import math
import random
import re
from dataclasses import replace

import pytest

from bench.faults.catalogue import FLOWN, GROUPS
from bench.faults.injectors import simulated, taken
from bench.fly.air import COMPLETED, HANDED_OVER, POSCTL, Air, Expected, Fault, Injector, When
from bench.fly.packets import ARM, SET_MODE, made, outside
from bench.studies.faults import FaultCase, flown_with, work_out_fault
from companion.mavlink.encode import COMPONENT_ID
from rebound_cli.live.interrupts import Interrupts
from sim_vehicle.airframe import load_built_in
from sim_vehicle.bench.faults import motor_failure, other
from sim_vehicle.scene import Scene
from sim_vehicle.vehicle import SimulatedVehicle
from tests.companion.fake_vehicle import flying_in
from tests.rebound_cli.command import ROOT

SETPOINT = {"x": 1.0, "z": -1.5, "type_mask": 0xDF8}


def test_every_group_has_rows_and_there_are_as_many_as_promised() -> None:
    promised = re.search(r"each of (\d+) faults", (ROOT / "docs/reference/faults.md").read_text())
    assert promised is not None and len(FLOWN) == int(promised[1]) and all(GROUPS.values())


@pytest.mark.parametrize(
    ("fields", "wrong"),
    [
        ({}, None),
        ({"x": math.nan}, "not finite"),
        ({"x": 40.0}, "outside the fence"),
        ({"z": 0.5}, "-0.5 m high"),
        ({"type_mask": 0xDC0, "vx": 30.0}, "30.0 m/s"),
        ({"type_mask": 0xC38, "afx": 20.0}, "20.0 m/s2 sideways"),
        ({"type_mask": 0xC38, "afz": 12.0}, "12.0 m/s2 up or down"),
        ({"type_mask": 0x9F8, "yaw": 4.0}, "yaw 4 rad"),
    ],
)
def test_what_lies_outside_the_envelope_is_named(fields: dict[str, float], wrong: str | None) -> None:
    core = flying_in("mission").companion.core
    assert core is not None
    assert outside(core, made("SET_POSITION_TARGET_LOCAL_NED", SETPOINT | fields)) == wrong


@pytest.fixture
def air() -> Air:
    """Around a companion that flies a mission, and a vehicle with a pilot."""
    vehicle = SimulatedVehicle(load_built_in("foldable"), Scene(), 1, links_may_fail=True)
    companion = flying_in("mission").companion
    air = Air(vehicle, companion, Interrupts(), Injector(), random.Random(1), 60.0)
    air.add_pilot()
    return air


def test_what_the_companion_sends_once_it_has_heard_of_the_pilot_counts(air: Air) -> None:
    setpoint = made("SET_POSITION_TARGET_LOCAL_NED", SETPOINT)
    # Given a pilot who has taken over, of which the companion has not heard
    air.take_over()
    air.send(setpoint)
    assert air.after_told == 0
    # When it has been handed the packet that says so
    air._waiting.append(made("CURRENT_MODE", {"custom_mode": POSCTL}))
    air.receive(0.0)
    # Then setpoints, modes and arming count, and nothing else does
    for frame in (setpoint, made("COMMAND_LONG", {"command": SET_MODE}), made("COMMAND_LONG", {"command": ARM})):
        air.send(frame)
    air.send(made("HEARTBEAT", {}))
    air.send(made("COMMAND_LONG", {"command": 511}))
    assert air.after_told == 3


def sending() -> Injector:
    """One setpoint far outside, as if the companion had sent it."""
    frame = made("SET_POSITION_TARGET_LOCAL_NED", SETPOINT | {"x": 40.0})
    return Injector(When("mission"), lambda air: air.send(frame))


def overruling() -> Injector:
    """Soon after the pilot has taken over, somebody asks for OFFBOARD in the companion's name."""

    def to_vehicle(air: Air, frames: list[bytes]) -> list[bytes]:
        if not air.has_pilot:
            return frames
        fields = {"command": SET_MODE, "param1": 1.0, "param2": 6.0, "target_system": 1, "target_component": 1}
        setpoint = SETPOINT | {"target_system": 1, "target_component": 1, "coordinate_frame": 1}
        ours = (1, COMPONENT_ID)
        return [made("SET_POSITION_TARGET_LOCAL_NED", setpoint, ours), made("COMMAND_LONG", fields, ours)]

    return replace(taken(When("mission", 0.3)), to_vehicle=to_vehicle)


@pytest.mark.slow
def test_a_judge_names_each_kind_of_loss() -> None:
    no_wall = Expected((COMPLETED, HANDED_OVER), finds=False, has_wall=False)
    bad = {
        "setpoint outside: outside the fence": lambda _: sending(),
        "the pilot was overruled": lambda _: overruling(),
        "tumbled: ": lambda _: simulated(motor_failure(0), When("mission", 0.3)),
        "1 false hits counted": lambda _: simulated(
            other("push", force_ned_n=(0.0, 12.0, 0.0), rise_s=0.01), When("mission", 0.3, 0.1)
        ),
    }
    for words, inject in bad.items():
        result = flown_with(Fault(words, "", inject, no_wall), 7)
        assert any(text.startswith(words) for text in result["complaints"]), (words, result)
        assert not result["hit"], "there is no wall"


@pytest.mark.slow
def test_what_a_wall_does_while_nothing_can_show_it_counts_only_where_the_row_says_that_something_can() -> None:
    # Given an accelerometer that is off in the second of a hit
    hidden = FLOWN["accelerometer zero"]
    shown = replace(hidden, expected=replace(hidden.expected, blinds=False))
    told, untold = (flown_with(fault, 42) for fault in (hidden, shown))
    assert told["unseen"] and told["complaints"] == []
    assert not untold["unseen"] and any(text.startswith(("fell: ", "tumbled: ")) for text in untold["complaints"])


@pytest.mark.slow
def test_a_killed_companion_leaves_a_vehicle_that_lands_and_a_log() -> None:
    result = work_out_fault(FaultCase(8, "SIGKILL in a recovery"))
    assert result["outcome"] == "killed" and result["complaints"] == [] and result["ground_m_s"] < 1.2


def test_a_pilot_who_takes_over_in_the_climb_is_left_alone() -> None:
    result = work_out_fault(FaultCase(9, "takes over in take-off"))
    assert result["outcome"] == "aborted" and result["complaints"] == [] and result["after_told"] == 0
