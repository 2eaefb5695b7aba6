"""Any packet at all: the vehicle flies on, and only what should change it does."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.messages import Identity
from sim_vehicle.mavlink.decode import Decoder
from tests.sim_vehicle.packets import KINDS, OBEYED, addressed_to, packet, random_payload
from tests.sim_vehicle.vehicle_client import Client


def state(client: Client) -> tuple:
    """What a packet that means nothing to this vehicle must not change."""
    autopilot = client.vehicle._board.autopilot
    parameters = client.vehicle.parameters
    return (
        autopilot.modes.flown,
        autopilot.modes.intended,
        autopilot.arming.armed,
        parameters.sets,
        autopilot.navigator.view.home_ned_m,
    )


def flying() -> Client:
    client = Client(system=255, component=190)
    client.take_off(9.0)
    assert client.armed()
    return client


def test_every_kind_of_message_with_senseless_content_is_survived_in_flight():
    chance, client = random.Random(21), flying()
    link = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    for number in range(6_000):
        kind = KINDS[number % len(KINDS)]
        payload = addressed_to(kind, random_payload(kind, chance), chance.choice((0, 1)), chance.choice((0, 1)))
        client.push(packet(kind, payload, link, v1=chance.random() < 0.1))
        if number % 4 == 0:
            client.step()
    client.run(2.5)
    assert client.last("HEARTBEAT").autopilot == 12


def test_what_is_not_for_this_vehicle_changes_nothing():
    chance, client = random.Random(22), flying()
    link = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    before = state(client)
    client.forget()
    for number in range(4_000):
        kind = KINDS[number % len(KINDS)]
        payload = random_payload(kind, chance)
        if kind.id in OBEYED:
            payload = addressed_to(kind, payload, chance.randrange(2, 256), chance.randrange(256))
        # The setpoints of a follow-me target and clocks of peers are for everybody
        if kind.id in (111, 144):
            continue
        client.push(packet(kind, payload, link))
        if number % 8 == 0:
            client.step()
    client.run(0.1)
    assert state(client) == before
    assert client.all("COMMAND_ACK") == []


@settings(max_examples=150, deadline=None)
@given(st.lists(st.binary(max_size=400), max_size=8))
def test_any_bytes_are_read_without_an_error_and_hold_nothing_up(pieces):
    decoder = Decoder(Identity(), range(1000))
    for piece in pieces:
        decoder.push(piece)
    # What is left of noise cannot hide more than one longest packet
    heartbeat = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(dialect.MAVLink(None, 255, 190))
    assert any(decoder.push(heartbeat))


COMMANDS = st.one_of(st.integers(0, 700), st.sampled_from([2000, 2001, 2500, 3000, 30001, 43003]))
NUMBERS = st.one_of(st.floats(width=32), st.integers(-3, 300).map(float), st.sampled_from([360.0, 397.0, 435.0]))


@pytest.fixture(scope="module")
def airborne() -> Client:
    return flying()


@settings(max_examples=200, deadline=None)
@given(command=COMMANDS, params=st.lists(NUMBERS, min_size=7, max_size=7), is_int=st.booleans())
def test_every_command_with_any_parameter_is_answered_at_most_twice(airborne, command, params, is_int):
    client = airborne
    client.forget()
    if is_int:
        x, y = (int(max(min(value, 2e9), -2e9)) if value == value else 0 for value in params[4:6])
        client.send(dialect.MAVLink_command_int_message(1, 1, 6, command, 0, 0, *params[:4], x, y, params[6]))
    else:
        client.command(command, *params)
    client.run(0.02)
    assert len(client.results(command)) <= 2
