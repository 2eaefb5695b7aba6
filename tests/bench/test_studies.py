"""Studies, each flown and judged as stated: the table of faults, and ablations."""

import math
import random
import re
from dataclasses import replace

import pytest

from bench.faults.catalogue import FLOWN, GROUPS
from bench.faults.injectors import simulated, taken
from bench.fly.air import COMPLETED, HANDED_OVER, POSCTL, Air, Expected, Fault, Injector, When
from bench.fly.packets import ARM, SET_MODE, made, outside
from bench.studies.ablation import RULES, Rule, flights_table, switched
from bench.studies.faults import FaultCase, flown_with, work_out_fault
from companion.mavlink.encode import COMPONENT_ID
from companion.motion.vector import ZERO
from companion.reflex import surface
from companion.reflex.belief.filter_bank import FilterBank
from companion.reflex.recovery import attitude_law
from companion.reflex.surface import MotionState
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
    assert outside(core, made("SET_POSITION_TARGET_LOCAL_NED", SETPOINT | fields)) == wrong


def test_what_the_companion_sends_once_it_has_heard_of_the_pilot_counts() -> None:
    vehicle = SimulatedVehicle(load_built_in("foldable"), Scene(), 1, links_may_fail=True)
    air = Air(vehicle, flying_in("mission").companion, Interrupts(), Injector(), random.Random(1), 60.0)
    setpoint = made("SET_POSITION_TARGET_LOCAL_NED", SETPOINT)
    # Given a pilot who has taken over, of which the companion has not heard
    air.add_pilot()
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
    # One setpoint far outside, as if the companion had sent it
    far = made("SET_POSITION_TARGET_LOCAL_NED", SETPOINT | {"x": 40.0})
    bad = {
        "setpoint outside: outside the fence": lambda _: Injector(When("mission"), lambda air: air.send(far)),
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


RECOVERED = {"past_m": 0.02, "lost_m": 0.03, "rest_s": 1.2, "normal_deg": 5.0, "recovered": True}


def flown(copies):
    """Three steps, of which the second is the rule's."""
    steps = [("first",), surface.plus((0, 0, 0), 1.0, (1, 0, 0)), attitude_law.plus((1, 0, 0), 1.0, (1, 0, 0))]
    copies.leave(lambda: {"steps": steps})
    return steps


def test_a_copy_goes_on_without_the_rule_and_the_first_flight_with_it():
    with switched([Rule("away", "away from what was hit", "reflex.surface:plus", says=[9, 9, 9])]) as copies:
        steps = flown(copies)
    assert steps == [("first",), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
    # In the copy the rule is off from its first answer on, in every module that asks it.
    assert copies.found == {"away": {"steps": [["first"], [9, 9, 9], [9, 9, 9]]}}
    # And every rule is where its row says
    with switched(RULES):
        pass


def test_a_rule_that_only_remembers_is_left_out_although_it_answers_nothing():
    bank = FilterBank(MotionState(ZERO, (1.0, 0.0, 0.0)), 0.1, ZERO, 0)
    with switched([rule for rule in RULES if rule.name == "leaves"]) as copies:
        bank.leave((-1.0, 0.0, 0.0), 0.0, 0.1)
        copies.leave(lambda: bank.leaves.max())
    assert copies.found["leaves"] == 1.0 > bank.leaves.max()


def test_the_table_counts_what_is_lost_without_a_rule():
    well = {"ends": True, "hits": [RECOVERED]}
    lost = [{"ends": ends, "hits": [RECOVERED | {"recovered": False}]} for ends in (False, True)]
    flights = [{"with": well, "without": {"trust": without}} for without in lost]
    lines = flights_table(flights).splitlines()
    trust = next(line for line in lines if line.startswith("| trust"))
    assert [cell.strip() for cell in trust.split("|")][3:6] == ["2", "+1", "+2"]
    hand = next(line for line in lines if line.startswith("| hand "))
    assert [cell.strip() for cell in hand.split("|")][3:] == ["0", "+0", "+0", *["–"] * 5, ""]
