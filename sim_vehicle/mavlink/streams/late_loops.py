"""The loop that sends a link's streams is late now and then."""

import random

# Now and then the link's loop comes too late and misses one sample: PX4 asked for 250 Hz sends 246.
MISSED_LOOPS_SHARE = 0.012


class LateLoops:
    """The link's loop that now and then comes too late for a sample, which then nobody receives."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._missed_last = False

    def misses_this_one(self) -> bool:
        """Never two in a row: the gaps that were measured are of one sample."""
        missed = self._random.random() < MISSED_LOOPS_SHARE and not self._missed_last
        self._missed_last = missed
        return missed
