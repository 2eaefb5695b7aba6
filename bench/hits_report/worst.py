"""The hits nearest to being missed, with all that makes them again."""

from collections.abc import Iterator, Mapping, Sequence

from bench.campaign.plan import Json
from bench.hits.flight import APPROACHES
from bench.hits.worst import MEETING, NOTICED_M_S, VEHICLE, SearchCase


def worst(cases: Sequence[SearchCase], results: Mapping[int, Json]) -> Iterator[str]:
    tried = sum(one["flown"] for one in results.values())
    yield f"{tried:,} hits were tried by differential evolution. The margin is the factor by which all thresholds of"
    yield f"the detector could grow until the hit is missed: below 1 it is missed. Hits have {NOTICED_M_S} m/s into"
    yield "the surface at least. The vehicle is the named airframe with the numbers below."
    yield ""
    columns = [results[at] for at in results]
    names = [f"{cases[at].airframe}, {cases[at].imu_hz} Hz" for at in results]
    yield f"| | {' | '.join(names)} |"
    yield "|---" * (len(names) + 1) + "|"
    for key in ("margin", "closing_m_s", *MEETING, *VEHICLE):
        texts = [APPROACHES[round(one[key])] if key == "approach" else f"{one[key]:.6g}" for one in columns]
        yield f"| {key} | {' | '.join(texts)} |"
    yield ""
