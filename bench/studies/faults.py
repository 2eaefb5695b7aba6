"""`bench faults`: every fault and attack by the dozen, and the table of what became of them."""

from argparse import Namespace
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from bench.faults.catalogue import FLOWN, GROUPS
from bench.fly.air import ENDS
from bench.fly.campaign import Campaign, Json, Workers, run_campaign
from bench.rows.faulted import work_out_seed
from bench.rows.tables import Page, table
from companion.errors import ConfigurationError

GROUP_OF = {fault.name: group for group, faults in GROUPS.items() for fault in faults}
_SHOWN = 3


def run_faults(options: Namespace) -> int:
    """0 when every row did what is expected of it."""
    if options.only is not None:
        return _only(options.only, options.seeds)
    page, campaign = Page(options.out, "faults"), faults_campaign(options.seeds)
    results = run_campaign(campaign, Workers(options.jobs))
    found = by_name(list(results.results.values()))
    failing = [name for name, every in found.items() if any(one["complaints"] for one in every)]
    lead = f"{len(found)} faults, {sum(map(len, found.values()))} flights; {len(failing)} rows not as expected."
    parts = {"": f"{lead}\n\n{faults_table(found)}", "What was not as expected": complaints(found)}
    page.write("Faults and attacks", options.typed, parts)
    print(
        f"{len(found)} rows, {len(failing)} not as expected: {', '.join(failing) or 'none'}.\n{results.text(campaign)}"
    )
    return 1 if failing or results.failures else 0


def faults_campaign(seeds: int) -> Campaign:
    """A case is a seed with every fault."""
    cases = [(number, tuple(FLOWN)) for number in range(seeds)]
    # Not how many: more seeds go on where fewer ended.
    return Campaign("faults", {}, cases, work_out_seed)


def by_name(seeds: Sequence[Json]) -> dict[str, list[Json]]:
    return {name: [seed[name] for seed in seeds] for name in FLOWN}


def faults_table(found: Mapping[str, Sequence[Json]]) -> str:
    """A row a fault: what is injected, expected and happened, the worst of it, and the verdict."""
    rows = []
    for name, results in found.items():
        fault = FLOWN[name]
        bad = sum(bool(result["complaints"]) for result in results)
        happened, worst = _flights(results)
        rows.append(
            {
                "kind": GROUP_OF[name],
                "fault": name,
                "injected": fault.injected,
                "expected": fault.expected.text(),
                "n": len(results),
                "happened": happened,
                "worst": worst,
                "verdict": f"**{bad} of {len(results)} not**" if bad else "holds",
            }
        )
    return table(rows)


def _flights(results: Sequence[Json]) -> tuple[str, str]:
    whole = [result for result in results if "tilt_deg" in result]
    happened = _counted(ENDS.get(result.get("outcome", "broken"), "broken") for result in results)
    hits = [result for result in whole if result["hit"]]
    happened += f"; hits found {sum(result['found'] for result in hits)} of {len(hits)}"
    told = (("unseen", "of them met unseen"), ("false", "counted for nothing"), ("unconfirmed", "taken back"))
    for key, words in told:
        number = sum(result.get(key, 0) for result in whole)
        happened += f", {number} {words}" if number else ""
    if not whole:
        return happened, "–"
    ground = [result["ground_m_s"] for result in whole if result["ground_m_s"] is not None]
    again = max(result["again_m_s"] for result in whole)
    worst = [f"tilt {max(result['tilt_deg'] for result in whole):.0f}°"]
    worst += [f"ground {max(ground):.2f} m/s"] if ground else []
    worst += [f"second contact {again:.2f} m/s"] if again > 0.0 else []
    return happened, ", ".join(worst)


def complaints(found: Mapping[str, Sequence[Json]]) -> str:
    """The commonest of each row, without the moment, so that one cause counts as one; of a traceback the last line."""
    rows = []
    for name, results in found.items():
        texts = [text for result in results for text in result["complaints"]]
        causes = Counter(text.strip().splitlines()[-1].partition(" at ")[0][:160] for text in texts)
        rows += [{"fault": name, "times": count, "what": cause} for cause, count in causes.most_common(_SHOWN)]
    return table(rows)


def _counted(names: Iterable[str]) -> str:
    return ", ".join(f"{name} {count}" for name, count in Counter(names).most_common())


def _only(name: str, seeds: int) -> int:
    if name not in FLOWN:
        raise ConfigurationError(f"--only {name}: there is no such fault; there are {', '.join(FLOWN)}.")
    results = [work_out_seed((number, [name]))[name] for number in range(seeds)]
    for number, result in enumerate(results):
        print(f"{number}: {result}")
    return 1 if any(result["complaints"] for result in results) else 0
