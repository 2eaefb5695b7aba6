"""Hostile but well-formed messages by the hundred thousand: `python -m tests.benchmarks.bench_hostile [--messages N]`.

Prints how many were sent in which state, what became of the flights, and every step that broke: a setpoint outside the
envelope, a value that is not finite, a fault. Exit code 1 when there was one.
"""

import argparse
import collections
import random

from tests.companion.hostile import HEARD, STATES, Attacker, attacked, flight_in
from tests.companion.test_hostile_messages import AUTHORITY

STEPS_A_FLIGHT = 500


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--messages", type=int, default=300_000)
    parser.add_argument("--seed", type=int, default=1000)
    options = parser.parse_args()
    sent: collections.Counter[str] = collections.Counter()
    ended: collections.Counter[str] = collections.Counter()
    broken: list[str] = []
    seed = options.seed
    while sum(sent.values()) < options.messages:
        for state in STATES:
            seed += 1
            fly(state, seed, sent, ended, broken)
    print(f"{sum(sent.values())} hostile messages, seeds {options.seed + 1} to {seed}")
    for state, count in sorted(sent.items()):
        print(f"  heard in {state:<12}{count:>8}")
    for way, count in sorted(ended.items()):
        print(f"  {way:<28}{count:>6} flights")
    print(f"{len(broken)} broken", *broken, sep="\n")
    return 1 if broken else 0


def fly(
    state: str, seed: int, sent: collections.Counter[str], ended: collections.Counter[str], broken: list[str]
) -> None:
    """One flight attacked from the state on; every second one by all messages, the others by all but authority's."""
    f, chance = flight_in(state), random.Random(seed)
    attacker = Attacker(f.vehicle, seed)
    kinds = HEARD if seed % 2 else sorted({*HEARD} - {*AUTHORITY})
    try:
        for _ in range(STEPS_A_FLIGHT):
            packets = [attacker.packet(chance.choice(kinds)) for _ in range(chance.choice((0, 0, 1, 1, 2)))]
            sent[f.state] += len(packets)
            attacked(f, packets)
    except Exception as error:
        broken.append(f"seed {seed} from {state}: {type(error).__name__}: {error}")
    broken.extend(f"seed {seed} from {state}: {event.text}" for event in f.events if event.kind == "fault")
    ended[f"{state} to {f.state}"] += 1


if __name__ == "__main__":
    raise SystemExit(main())
