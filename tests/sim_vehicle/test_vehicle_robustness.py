"""Whatever bytes arrive, the vehicle flies on; and the same bytes give the same flight."""

import random

from pymavlink.dialects.v20 import development as dialect

from tests.sim_vehicle.vehicle_client import ARM_DISARM, TAKEOFF, Client

ANSWERED = (0, 75, 76, 84, 111)


def scripted(seed: int, steps: int = 1_500) -> bytes:
    client = Client(seed)
    client.command(TAKEOFF)
    client.command(ARM_DISARM, 1)
    for _ in range(steps):
        client.step()
    return b"".join(client.sent)


def test_the_same_seed_gives_the_same_bytes():
    first = scripted(seed=3)
    assert first == scripted(seed=3)
    assert first != scripted(seed=4)


def test_noise_and_damaged_packets_change_nothing_and_raise_nothing():
    # Given a vehicle that is sent every packet of a conversation, each damaged in a random place
    chance = random.Random(11)
    client = Client()
    link = dialect.MAVLink(None, srcSystem=1, srcComponent=191)
    good = [
        dialect.MAVLink_command_long_message(1, 1, ARM_DISARM, 0, 1, 21196, 0, 0, 0, 0, 0),
        dialect.MAVLink_command_long_message(1, 1, 176, 0, 1, 6, 0, 0, 0, 0, 0),
        dialect.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0xDF8, *[1.0] * 11),
        dialect.MAVLink_timesync_message(0, 1),
    ]
    for number in range(2_000):
        raw = bytearray(good[number % len(good)].pack(link))
        kind = chance.randrange(3)
        if kind == 0:
            raw[chance.randrange(len(raw))] ^= 1 << chance.randrange(8)
        elif kind == 1:
            # With one byte missing only, what comes next could happen to be that byte
            raw = raw[: chance.randrange(len(raw) - 1)]
        else:
            raw = bytearray(chance.randbytes(chance.randrange(300)))
        client.send_raw(bytes(raw))
        client.step()
    # Then nothing of it was obeyed
    assert client.all("COMMAND_ACK") == []
    assert not client.armed()
    # And an undamaged command still is
    client.command(ARM_DISARM, 1)
    client.run(0.1)
    assert client.results(ARM_DISARM) == [0]


def test_valid_packets_with_senseless_content_raise_nothing():
    chance = random.Random(12)
    client = Client()
    link = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    for _ in range(3_000):
        kind = dialect.mavlink_map[chance.choice(ANSWERED)]
        payload = chance.randbytes(kind.unpacker.size)
        message = kind(*[0] * len(kind.fieldnames))
        v1 = chance.random() < 0.2
        raw = bytearray(message._pack(link, kind.crc_extra, payload, force_mavlink1=v1))
        client.send_raw(bytes(raw))
        client.step()
    assert client.time_s > 12.0


def test_every_command_number_survives_every_odd_parameter():
    client = Client()
    odd = [float("nan"), float("inf"), -float("inf"), 3e38, -3e38, 0.5, -1.0, 255.0, 65_536.0]
    chance = random.Random(13)
    for number in (20, 21, 22, 176, 400, 510, 511, 512, 520):
        for _ in range(60):
            client.command(number, *[chance.choice(odd) for _ in range(7)])
            client.step()
    client.run(1.0)
    assert client.all("HEARTBEAT")


def test_mavlink_1_commands_are_obeyed():
    client = Client()
    link = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    message = dialect.MAVLink_command_long_message(1, 1, ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0)
    client.send_raw(message.pack(link, force_mavlink1=True))
    client.run(0.1)
    assert client.results(ARM_DISARM) == [0]
