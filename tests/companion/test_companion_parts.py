"""The small parts of a flight: settling, commands, authority."""

import pytest

from companion.flight.ending import Holder, who_decided
from companion.link.commands import CommandClient
from companion.link.vehicle import ModeReport, Vehicle
from companion.messages import (
    CommandAck,
    CommandResult,
    CurrentMode,
    Heartbeat,
    RequestMessage,
    SetMode,
)
from companion.motion.config import SettledConfig
from companion.motion.settling import SettlingMonitor
from companion.px4_mode import AUTO_LAND, AUTO_LOITER, OFFBOARD

# --- settling


def settled(motions, **config):
    monitor = SettlingMonitor(SettledConfig(**config))
    return [monitor.settled_since(20_000 * tick, *motion) for tick, motion in enumerate(motions, 1)]


def at_rest(ticks):
    return [(0.05, (0.0, 0.0, 0.0))] * ticks


def test_settled_after_half_a_second_at_rest_and_not_before():
    since = settled(at_rest(50))
    assert since[24] is None
    assert since[25] == 20_000


@pytest.mark.parametrize("motion", [(0.15, (0.0, 0.0, 0.0)), (0.0, (0.15, 0.0, 0.0))])
def test_too_far_or_too_fast_is_not_settled(motion):
    assert set(settled([motion] * 150)[5:]) == {None}


def test_a_break_starts_the_time_anew():
    results = settled(at_rest(20) + [(0.2, (0.0, 0.0, 0.0))] * 2 + at_rest(50))
    first = next(i for i, r in enumerate(results) if r is not None)
    assert results[first] == 460_000
    assert first == 47


# --- command client


def begun(command):
    client = CommandClient()
    client.begin(command)
    return client


def test_accepted_then_rejected_is_a_rejection():
    client, sent_us = begun(SetMode(OFFBOARD)), []
    answers = {10_000: CommandResult.ACCEPTED, 20_000: CommandResult.TEMPORARILY_REJECTED}
    for now_us in range(0, 1_500_000, 10_000):
        acks = [CommandAck(176, answers[now_us])] if now_us in answers else []
        send, _ = client.step(acks, False, now_us)
        sent_us += [now_us] if send is not None else []
    assert sent_us == [0, 1_020_000], "asked again a second after the rejection"


def test_other_commands_count_when_accepted_and_answers_to_others_do_not():
    client = begun(RequestMessage(148))
    client.step([], False, 0)
    assert client.step([CommandAck(400, CommandResult.ACCEPTED)], False, 1000) == (None, None)
    _, outcome = client.step([CommandAck(512, CommandResult.ACCEPTED)], False, 2000)
    assert outcome.succeeded
    assert not client.busy


# --- authority

POSCTL = 3 << 16


@pytest.mark.parametrize(
    ("report", "requested", "holder"),
    [
        (ModeReport(OFFBOARD, OFFBOARD, False), None, Holder.COMPANION),
        (ModeReport(OFFBOARD, None, True), None, Holder.COMPANION),
        (ModeReport(AUTO_LAND, AUTO_LAND, False), AUTO_LAND, Holder.COMPANION),
        (ModeReport(OFFBOARD, AUTO_LAND, False), AUTO_LAND, Holder.COMPANION),
        (ModeReport(AUTO_LAND, AUTO_LAND, False), None, Holder.PILOT),
        (ModeReport(POSCTL, POSCTL, False), None, Holder.PILOT),
        (ModeReport(POSCTL, POSCTL, False), AUTO_LAND, Holder.PILOT),
        (ModeReport(POSCTL, None, False), None, Holder.PILOT),
        (ModeReport(POSCTL, OFFBOARD, False), None, Holder.FAILSAFE),
        (ModeReport(AUTO_LOITER, None, True), None, Holder.FAILSAFE),
    ],
)
def test_own_request_failsafe_and_pilot_are_told_apart(report, requested, holder):
    assert who_decided(report, OFFBOARD, requested) is holder


def test_an_intended_mode_is_newer_than_the_last_heartbeats_status():
    """A failsafe was on at the last HEARTBEAT; what the pilot intends since then is told by CURRENT_MODE."""
    vehicle = Vehicle()
    vehicle.update(Heartbeat(1, 1, 2, 12, True, OFFBOARD, 5), 0)
    vehicle.update(CurrentMode(POSCTL, POSCTL), 1)
    assert who_decided(vehicle.mode, OFFBOARD, None) is Holder.PILOT
    vehicle.update(CurrentMode(POSCTL, None), 2)
    assert who_decided(vehicle.mode, OFFBOARD, None) is Holder.FAILSAFE
