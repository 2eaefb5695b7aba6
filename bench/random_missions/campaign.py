"""The campaign of random missions: each flown by both airframes."""

from bench.campaign.plan import Campaign, Json
from bench.random_missions.contacts import contacts_of
from bench.random_missions.flight import fly
from bench.random_missions.generator import AIRFRAMES, MissionCase, random_mission
from bench.random_missions.judge import failures
from bench.random_missions.recovered import recoveries

# The first hit of every fifth mission shows what the feed-forward of the height is worth.
COMPARED_EVERY = 5


def missions_campaign(missions: int, first_seed: int = 1, is_drawn: bool = False) -> Campaign:
    """Seeds from the first on, each with every airframe; then some again without the feed-forward of the height.

    `is_drawn`: with a vehicle drawn from each seed, of the two airframes' kinds.
    """
    seeds = range(first_seed, first_seed + missions)
    cases = [MissionCase(seed, name, is_drawn=is_drawn) for seed in seeds for name in AIRFRAMES]
    some = [seed for seed in seeds if seed % COMPARED_EVERY == 0]
    cases += [MissionCase(seed, name, False, is_drawn) for seed in some for name in AIRFRAMES]
    parameters = {"missions": missions, "first_seed": first_seed, "is_drawn": is_drawn}
    return Campaign("missions", parameters, cases, work_out_mission)


def work_out_mission(case: MissionCase) -> Json:
    """What became of it."""
    drawn = random_mission(case)
    flight = fly(case, drawn)
    contacts = contacts_of(flight)
    return {
        "room": drawn.room,
        "stream_hz": drawn.stream_hz,
        "wind_m_s": drawn.wind_m_s,
        "extras": list(drawn.extras),
        "items": [next(iter(item)) for item in drawn.data["items"]],
        "outcome": flight.report.outcome,
        "seconds": round(1e-6 * (flight.report.ended_at_us - flight.report.started_at_us), 3),
        "failures": [[failure.cause, failure.details] for failure in failures(flight)],
        "detours": sum(event.kind == "detour" for event in flight.events),
        "unreachable": sum(event.kind == "unreachable" for event in flight.events),
        "hits": recoveries(flight, contacts),
    }
