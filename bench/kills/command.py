"""`bench kills`: a table by the instant of the kill, written into a note."""

import statistics
from argparse import Namespace
from collections.abc import Iterator, Sequence

from bench.campaign.plan import Campaign, Json
from bench.campaign.run import Results, Workers, failures_text, run_campaign
from bench.kills.killed import KILLED_S, kills_campaign
from bench.marked import checked_text, write_part
from bench.stamps import stamp_text

PART, TITLE = "kills", "A companion that is killed around a hit"
BIN_S = 0.1
# A softer touch than this is what guards are for: the goal counts harder ones alone.
SECOND_M_S = 0.3


def run_kills(options: Namespace) -> int:
    """0 when the table is written, whatever it says; 1 when a flight failed to be flown."""
    options.out.parent.mkdir(parents=True, exist_ok=True)
    checked_text(options.out, PART, TITLE)
    campaign = kills_campaign(options.kills, options.first_seed)
    results = run_campaign(campaign, Workers(options.jobs, options.scheduler))
    write_part(options.out, PART, table(campaign, results), TITLE)
    print(f"Written to {options.out}.")
    return 1 if results.failures else 0


def table(campaign: Campaign, results: Results) -> str:
    """What stands between the note's marks."""
    lines = _lines(list(results.results.values()), campaign.parameters["first_seed"])
    return "\n".join([*lines, failures_text(campaign, results), ""])


def _lines(flights: Sequence[Json], first_seed: int) -> Iterator[str]:
    kills = [kill for flight in flights for kill in flight["kills"]]
    stamp = stamp_text(f"python -m bench kills --kills {len(kills)} --first-seed {first_seed}")
    yield f"{stamp}: {len(flights)} flights, both"
    yield "airframes, IMU at 250 and 50 Hz; 0.7 to 5 m/s, up to 45° slanted. After the kill nothing is sent;"
    yield "PX4 holds the last setpoint for COM_OF_LOSS_T, 1 s, and lands. Second contact: the centre closes"
    yield f"with the wall at more than {SECOND_M_S:g} m/s after the kill, the hit itself apart. All by the truth."
    yield ""
    yield "| killed, after the touch | kills | second contact | hardest | at the ground, median | most |"
    yield "|---|---|---|---|---|---|"
    first, last = (round(edge / BIN_S) for edge in KILLED_S)
    for number in range(first, last):
        inside = [kill for kill in kills if number <= kill["kill_s"] / BIN_S < number + 1]
        yield _row(f"{number * BIN_S * 1e3:.0f} to {(number + 1) * BIN_S * 1e3:.0f} ms", inside)
    yield _row("**before the touch**", [kill for kill in kills if kill["kill_s"] < 0.0])
    yield _row("**after it**", [kill for kill in kills if kill["kill_s"] >= 0.0])
    yield ""
    again = sum(flight["again_m_s"] > SECOND_M_S for flight in flights)
    yield f"With nobody killed, {again} of {len(flights)} of these flights touch a second time so hard."


def _row(name: str, kills: Sequence[Json]) -> str:
    if not kills:
        return f"| {name} | 0 | – | – | – | – |"
    again = [kill["again_m_s"] for kill in kills if kill["again_m_s"] > SECOND_M_S]
    ground = [kill["ground_m_s"] for kill in kills if kill["ground_m_s"] is not None]
    share = f"{len(again)} ({100 * len(again) / len(kills):.1f} %)"
    hardest = f"{max(again):.2f} m/s" if again else "–"
    down = f"{statistics.median(ground):.2f} m/s | {max(ground):.2f} m/s" if ground else "– | –"
    return f"| {name} | {len(kills)} | {share} | {hardest} | {down} |"
