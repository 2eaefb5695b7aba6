"""One seed: its faults from one take-off, and the files that mean harm."""

from collections.abc import Callable, Sequence

from bench.campaign.plan import Json
from bench.faults.catalogue import FILES, FLOWN
from bench.faults.flight import fly, fly_from_one_take_off
from bench.faults.kinds.files import tried


def fly_seed(case: tuple[int, Sequence[str]]) -> Json:
    """What became of each of these faults with one seed, by name."""
    results: Json = {}
    fly_faults(*case, results.__setitem__)
    return results


def fly_faults(number: int, names: Sequence[str], take: Callable[[str, Json], object]) -> None:
    """`take` is given each fault's name and what became of it with this seed."""
    branching = [FLOWN[name] for name in names if name in FLOWN and not FLOWN[name].from_the_start]
    if branching:
        fly_from_one_take_off(number, branching, take)
    for name in names:
        if name in FILES:
            take(name, tried(FILES[name], number))
        elif FLOWN[name].from_the_start:
            take(name, fly(number, FLOWN[name]))
