"""Hostile messages by the hundred thousand: `python -m tests.benchmarks.bench_hostile [--messages N] [--most N]`.

Well-formed messages in the vehicle's name: any kind, any field, any value. With `--damaged` a share of them is spoiled
on its bytes besides: bits, a part that is missing, noise. Prints how many were sent in which state, what became of the
flights, and every step that broke: a setpoint outside the envelope, a value that is not finite, a fault. Exit code 1
when there was one.
"""

import argparse
import collections
import random

from tests.companion.fake_vehicle import Flight
from tests.companion.hostile import HEARD, STATES, Attacker, attacked, flight_in
from tests.companion.test_hostile_messages import AUTHORITY

STEPS_A_FLIGHT = 500


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--messages", type=int, default=300_000)
    parser.add_argument("--most", type=int, default=2, help="messages in one step of 4 ms")
    parser.add_argument("--damaged", type=float, default=0.0, help="share of them that is spoiled on its bytes, too")
    parser.add_argument("--seed", type=int, default=1000)
    options = parser.parse_args()
    sent: collections.Counter[str] = collections.Counter()
    ended: collections.Counter[str] = collections.Counter()
    broken: list[str] = []
    seed = options.seed
    while sum(sent.values()) < options.messages:
        for state in STATES:
            seed += 1
            fly(flight_in(state), state, seed, options, sent, ended, broken)
    print(f"{sum(sent.values())} hostile messages, seeds {options.seed + 1} to {seed}")
    for state, count in sorted(sent.items()):
        print(f"  heard in {state:<12}{count:>8}")
    for way, count in sorted(ended.items()):
        print(f"  {way:<28}{count:>6} flights")
    print(f"{len(broken)} broken", *broken, sep="\n")
    return 1 if broken else 0


def fly(
    f: Flight,
    state: str,
    seed: int,
    options: argparse.Namespace,
    sent: collections.Counter[str],
    ended: collections.Counter[str],
    broken: list[str],
) -> None:
    """One flight attacked from the state on; every second one by all messages, the others by all but authority's."""
    chance = random.Random(seed)
    attacker = Attacker(f.vehicle, seed)
    kinds = HEARD if seed % 2 else sorted({*HEARD} - {*AUTHORITY})
    told = len(f.events)
    try:
        for _ in range(STEPS_A_FLIGHT):
            if f.companion.finished:
                break
            count = max(0, chance.randint(-(options.most // 2), options.most))
            packets = [attacker.packet(chance.choice(kinds)) for _ in range(count)]
            sent[f.state] += count
            attacked(f, [damaged(one, chance) if chance.random() < options.damaged else one for one in packets])
    except Exception as error:
        broken.append(f"seed {seed} from {state}: {type(error).__name__}: {error}")
    broken.extend(f"seed {seed} from {state}: {event.text}" for event in f.events[told:] if event.kind == "fault")
    ended[f"{state} to {f.state}"] += 1


def damaged(packet: bytes, chance: random.Random) -> bytes:
    """With some bits turned, a part missing, or noise after it."""
    content = bytearray(packet)
    way = chance.randrange(3)
    if way == 0:
        for _ in range(chance.randint(1, 8)):
            content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    elif way == 1:
        at = chance.randrange(len(content))
        del content[at : at + chance.randint(1, len(content))]
    else:
        content += chance.randbytes(chance.randint(1, 60))
    return bytes(content)


if __name__ == "__main__":
    raise SystemExit(main())
