"""The small parts of a flight: line profiles, settling, commands, authority, identity."""

import random

import pytest

from companion.flight.ending import Holder, who_decided
from companion.link.commands import CommandClient
from companion.link.vehicle import Identity, ModeReport, Vehicle, identify
from companion.messages import (
    CommandAck,
    CommandResult,
    CurrentMode,
    Heartbeat,
    RequestMessage,
    SetArmed,
    SetMode,
)
from companion.motion.config import SettledConfig
from companion.motion.settling import SettlingMonitor
from companion.px4_mode import AUTO_LAND, AUTO_LOITER, OFFBOARD

# --- trajectory


# --- settling


def settled(motions, **config):
    monitor = SettlingMonitor(SettledConfig(**config))
    return [monitor.settled_since(20_000 * tick, *motion) for tick, motion in enumerate(motions, 1)]


def at_rest(ticks, noise_m_s=0.0, seed=3):
    rng = random.Random(seed)
    return [(0.05, (rng.gauss(0.0, noise_m_s), rng.gauss(0.0, noise_m_s), 0.0)) for _ in range(ticks)]


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


def test_the_noise_of_a_good_estimate_does_not_keep_a_vehicle_from_settling():
    for seed in range(20):
        assert settled(at_rest(50, noise_m_s=0.03, seed=seed))[-1] is not None


# --- command client


def drive(client, until_us, answers=None, seen_at_us=None, step_us=10_000):
    """Step on virtual time; `answers`: time -> result. Returns send times and the outcome with its time."""
    sends, answers = [], dict(answers or {})
    for now_us in range(0, until_us, step_us):
        acks = [CommandAck(176, answers.pop(now_us))] if now_us in answers else []
        send, outcome = client.step(acks, seen_at_us is not None and now_us >= seen_at_us, now_us)
        if send is not None:
            sends.append((now_us, send.confirmation))
        if outcome is not None:
            return sends, outcome, now_us
    return sends, None, until_us


def begun(command):
    client = CommandClient()
    client.begin(command)
    return client


def test_a_mode_counts_when_it_is_seen_not_when_it_is_accepted():
    sends, outcome, at_us = drive(begun(SetMode(OFFBOARD)), 5_000_000, {10_000: CommandResult.ACCEPTED}, 300_000)
    assert len(sends) == 1
    assert outcome.succeeded
    assert at_us == 300_000


def test_accepted_then_rejected_is_a_rejection():
    answers = {10_000: CommandResult.ACCEPTED, 20_000: CommandResult.TEMPORARILY_REJECTED}
    sends, _, _ = drive(begun(SetMode(OFFBOARD)), 1_500_000, answers)
    assert [t for t, _ in sends] == [0, 1_020_000], "asked again a second after the rejection"


@pytest.mark.parametrize("result", [CommandResult.DENIED, CommandResult.UNSUPPORTED, CommandResult.FAILED])
def test_a_final_refusal_is_final(result):
    sends, outcome, _ = drive(begun(SetMode(OFFBOARD)), 5_000_000, {10_000: result})
    assert len(sends) == 1
    assert not outcome.succeeded
    assert result.name in outcome.text


def test_other_commands_count_when_accepted_and_answers_to_others_do_not():
    client = begun(RequestMessage(148))
    client.step([], False, 0)
    assert client.step([CommandAck(400, CommandResult.ACCEPTED)], False, 1000) == (None, None)
    _, outcome = client.step([CommandAck(512, CommandResult.ACCEPTED)], False, 2000)
    assert outcome.succeeded
    assert not client.busy


def test_arming_counts_when_it_is_seen():
    client = begun(SetArmed(True))
    client.step([], False, 0)
    assert client.step([CommandAck(400, CommandResult.ACCEPTED)], False, 1000)[1] is None
    assert client.step([], True, 2000)[1].succeeded


def test_only_a_mode_on_its_way_is_a_requested_mode():
    client = begun(SetMode(AUTO_LAND))
    assert client.requested_mode == AUTO_LAND
    client.cancel()
    assert client.requested_mode is None


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


# --- identity


@pytest.mark.parametrize("vehicle_type", [2, 13, 14, 15, 29])
def test_px4_multicopters_are_accepted(vehicle_type):
    assert isinstance(identify(Heartbeat(3, 1, vehicle_type, 12, False, 0, 3)), Identity)
