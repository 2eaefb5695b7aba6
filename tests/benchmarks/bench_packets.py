"""A million packets, random, senseless and damaged: `python tests/benchmarks/bench_packets.py [COUNT]`.

The vehicle must survive them all; what does not carry a right checksum and this vehicle's number must not change it.
Prints how many packets a second the receiving side takes.
"""

import random
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from pymavlink.dialects.v20 import development as dialect

from tests.sim_vehicle.packets import KINDS, OBEYED, addressed_to, damaged, packet, random_payload
from tests.sim_vehicle.test_vehicle_fuzz import flying, state
from tests.sim_vehicle.vehicle_client import Client

COUNT = 1_000_000
# So many come between two steps of the vehicle.
_BATCH = 200


def harmless(chance: random.Random, link: dialect.MAVLink) -> bytes:
    """Noise, a damaged packet, or one that is for somebody else."""
    choice = chance.random()
    if choice < 0.1:
        return chance.randbytes(chance.randrange(60)) + bytes(300)
    kind = chance.choice(KINDS)
    payload = addressed_to(kind, random_payload(kind, chance), chance.randrange(2, 256), 1)
    if choice < 0.4:
        # The zeros keep what follows from completing it.
        return damaged(packet(kind, payload, link), chance) + bytes(300)
    return b"" if kind.id in (111, 144) else packet(kind, payload, link)


def senseless(chance: random.Random, link: dialect.MAVLink) -> bytes:
    """For this vehicle, with any content."""
    kind = chance.choice([kind for kind in KINDS if kind.id in OBEYED])
    return packet(kind, addressed_to(kind, random_payload(kind, chance), 1, 1), link)


def feed(client: Client, make: object, count: int, chance: random.Random) -> float:
    """Seconds that the vehicle needed; making the packets is not counted."""
    assert callable(make)
    link, seconds = dialect.MAVLink(None, srcSystem=255, srcComponent=190), 0.0
    for _ in range(count // _BATCH):
        raw = b"".join(make(chance, link) for _ in range(_BATCH))
        begun = time.perf_counter()
        client.vehicle.step(raw)
        seconds += time.perf_counter() - begun
        # A key that noise has set would turn all the rest away.
        client.vehicle._signing.key = None
    return seconds


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else COUNT
    chance, client = random.Random(1), flying()
    before = state(client)
    seconds = feed(client, harmless, count // 2, chance)
    assert state(client) == before, "a packet changed the vehicle that should not have"
    print(f"{count // 2} packets that mean nothing to it: nothing changed, {count / 2 / seconds:,.0f} a second")
    seconds = feed(client, senseless, count // 2, chance)
    client.run(3.0)
    assert client.all("HEARTBEAT")
    print(f"{count // 2} packets for it with senseless content: survived, {count / 2 / seconds:,.0f} a second")


if __name__ == "__main__":
    main()
