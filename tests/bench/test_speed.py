"""The calls of an interval in lockstep are counted: a number without noise, which a busy machine does not change."""

import threading

import pytest

from bench.faults.latency import recorded
from bench.speed import px4
from bench.speed.calls import calls_an_interval, held_to
from bench.speed.flight import fly
from bench.speed.latency import of_peer
from bench.speed.parts import PARTS
from tests.sim_vehicle.hil.px4_client import Px4Client
from tests.sim_vehicle.hil.test_hil_tcp import free_port

# A change that costs more is looked at: it is made cheaper, or the count is renewed by `python -m bench speed --calls`.
MOST_MORE = 1.05


@pytest.fixture(scope="module")
def calls():
    fly()  # what is imported or compiled at first counts for nothing
    return calls_an_interval()


@pytest.mark.slow
@pytest.mark.parametrize("program", ["plant", "vehicle", "companion", "log"])
def test_no_program_calls_5_per_cent_more_functions_an_interval(calls, program):
    # Given the flight of wall.yaml, hit and recovery in it, and what its intervals were last held to
    parts = [part.name for part in PARTS if part.name.startswith(program)]
    now, held = (sum(found[name] for name in parts) for found in (calls, held_to()))
    # When it is flown now, then no part of the loop has become dearer unseen
    assert 0.0 < now <= MOST_MORE * held, f"{now:.1f} calls, held to {held:.1f}: docs/explanation/performance.md"


@pytest.mark.slow
def test_the_count_is_the_same_in_every_flight(calls):
    assert calls_an_interval() == calls


@pytest.mark.realtime
@pytest.mark.parametrize("name", ["pymavlink", "mavsdk"])
def test_a_program_that_only_answers_is_timed_at_each_hit(name):
    # Given a flight that is played to it until the hit, again and again
    taken = list(of_peer(name)(recorded(0), 3))
    # Then each answer comes after the hit, and long before PX4 would miss a setpoint (COM_OF_LOSS_T, 1 s)
    assert all(seconds is not None and 0.0 < seconds < 0.5 for seconds in taken)


@pytest.mark.realtime
def test_a_step_of_the_lockstep_is_measured_with_a_body_and_without(monkeypatch):
    # Given a PX4 that answers every sample
    monkeypatch.setattr(px4, "_SETTLES_S", 0.2)
    monkeypatch.setattr(px4, "_MEASURED_S", 0.5)
    port, times_us = free_port(), []
    answering = threading.Thread(target=_answer_all, args=(port, times_us))
    answering.start()
    # When its lockstep is measured
    rows = {cells[1]: cells[2:4] for line in px4.lockstep_table(port, 1000) if (cells := line.split("|"))}
    answering.join()
    # Then both are told (which is longer is the machine's to say), and PX4's clock goes on evenly through both parts
    body_us, again_us = (float(cell) for cell in rows[" a step "])
    assert body_us > 0.0 and again_us > 0.0
    assert times_us == [1000 * step for step in range(1, len(times_us) + 1)]


def _answer_all(port, times_us):
    while True:
        try:
            client = Px4Client(port)
            break
        except ConnectionRefusedError:
            continue
    try:
        while True:
            client.next_step()
            times_us.append(client.times_us[-1])
            client.answer([0.0] * 4)
    except (EOFError, ConnectionError):
        client.close()
