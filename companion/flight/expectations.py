"""The item `expect`: assertions of a mission about its own flight, from their step on until they are decided."""

import math
from dataclasses import replace

from companion.flight.context import Expectation, FlightContext, as_text
from companion.mission import items
from companion.reflex.recovery.collision import CollisionReport
from companion.report import ExpectationReport


def describe(item: items.ExpectItem) -> str:
    """For people, as a wish."""
    match item.check:
        case items.ExpectHit() as hit:
            return f"a hit within {hit.within_s:g} s{_bounds(hit.min_speed_m_s, hit.max_speed_m_s, 'm/s')}"
        case items.ExpectNoHit(for_s=for_s):
            return "no hit from here on" if for_s is None else f"no hit for {for_s:g} s"
        case items.ExpectHits() as hits:
            if hits.exactly is not None:
                return f"{hits.exactly} {'hit' if hits.exactly == 1 else 'hits'} so far"
            return f"hits so far{_bounds(hits.at_least, hits.at_most, '')}"
        case items.ExpectRecovered() as recovered:
            within = "" if recovered.within_s is None else f" within {recovered.within_s:g} s"
            past = "" if recovered.max_overshoot_m is None else f", at most {recovered.max_overshoot_m:g} m too far"
            return f"the latest hit recovered from{within}{past}"
        case items.ExpectPosition(ned_m=place, within_m=within_m):
            return f"within {within_m:g} m of {as_text(place)}"
        case items.ExpectHeight() as height:
            return f"height{_bounds(height.min_m, height.max_m, 'm')}"
        case items.ExpectFlightTime(at_most_s=at_most_s):
            return f"at most {at_most_s:g} s since arming"


def begin(flight: FlightContext, label: str, item: items.ExpectItem, now_us: int) -> None:
    """Take up an expectation; what can be said at once is said."""
    _look(flight, _begun(flight, label, item, now_us), now_us)


def _begun(flight: FlightContext, label: str, item: items.ExpectItem, now_us: int) -> Expectation:
    expectation = Expectation(item, now_us, len(flight.collisions), ExpectationReport(label, describe(item)))
    flight.expectations.append(expectation)
    return expectation


def review(flight: FlightContext, now_us: int, is_over: bool = False) -> None:
    """Look at those that are still open. `is_over`: a hit that has not come will not, and none is none."""
    for expectation in flight.expectations:
        if expectation.report.met is None:
            _look(flight, expectation, now_us, is_over)
    if is_over and flight.armed_at_us is not None:
        _judge_the_rest(flight, now_us)


def _judge_the_rest(flight: FlightContext, now_us: int) -> None:
    """Those that the flight has not come to: what is said of the whole flight counts, and nothing else is met."""
    begun = {expectation.report.label for expectation in flight.expectations}
    for step in flight.steps[flight.step_index :]:
        if not isinstance(step.action, items.ExpectItem) or step.label in begun:
            continue
        expectation = _begun(flight, step.label, step.action, now_us)
        if isinstance(step.action.check, items.ExpectHits | items.ExpectRecovered | items.ExpectFlightTime):
            _look(flight, expectation, now_us)
        else:
            _decide(flight, expectation, now_us, False, "the flight did not come to it")


def _look(flight: FlightContext, expectation: Expectation, now_us: int, is_over: bool = False) -> None:
    verdict = _verdict(flight, expectation, now_us)
    if verdict is None and is_over:
        verdict = isinstance(expectation.item.check, items.ExpectNoHit), "none until the end of the flight"
    if verdict is not None:
        _decide(flight, expectation, now_us, *verdict)


def _decide(flight: FlightContext, expectation: Expectation, now_us: int, met: bool, detail: str) -> None:
    expectation.report = replace(expectation.report, met=met, detail=detail)
    text = f"{'met' if met else 'NOT met'}: {expectation.report.text} ({detail})"
    flight.report(now_us, "expect", text, met=met)


def _verdict(flight: FlightContext, expectation: Expectation, now_us: int) -> tuple[bool, str] | None:
    """Whether it is met, and what was found; None while a hit may still come."""
    hits = [record.report() for record in flight.collisions]
    since, waited_s = hits[expectation.hits_before :], (now_us - expectation.began_us) * 1e-6
    place = flight.mission_ned_m(flight.latest.position_ned_m)
    match expectation.item.check:
        case items.ExpectHit() as wanted:
            bounds = wanted.min_speed_m_s, wanted.max_speed_m_s
            found = next((hit for hit in since if _is_within(hit.impact_speed_m_s, *bounds)), None)
            if found is None:
                return (False, _heard_of(since)) if waited_s > wanted.within_s else None
            after_s = (found.detected_at_us - expectation.began_us) * 1e-6
            return after_s <= wanted.within_s, f"{found.impact_speed_m_s:.2f} m/s after {after_s:.2f} s"
        case items.ExpectNoHit(for_s=for_s):
            if since:
                return False, _heard_of(since)
            return (True, "none") if for_s is not None and waited_s > for_s else None
        case items.ExpectHits() as number:
            resume = flight.mission.resume
            count = len(hits) + (0 if resume is None else resume.hits)
            return _is_within(count, number.at_least, number.at_most) and number.exactly in (None, count), f"{count}"
        case items.ExpectRecovered() as recovered:
            if not hits:
                return False, "no hit"
            settled_s, past_m = hits[-1].settled_after_s, hits[-1].overshoot_m
            if settled_s is None:
                return False, "not settled"
            is_soon = _is_within(settled_s, None, recovered.within_s)
            is_good = is_soon and _is_within(past_m, None, recovered.max_overshoot_m)
            return is_good, f"settled after {settled_s:.2f} s, {past_m:.2f} m too far"
        case items.ExpectFlightTime(at_most_s=at_most_s):
            assert flight.armed_at_us is not None
            flown_s = (now_us - flight.armed_at_us) * 1e-6
            return flown_s <= at_most_s, f"{flown_s:.1f} s"
        case items.ExpectPosition(ned_m=goal, within_m=within_m):
            return math.dist(place, goal) <= within_m, as_text(place)
        case items.ExpectHeight() as height:
            return _is_within(-place[2], height.min_m or 0.0, height.max_m), f"{-place[2]:.2f} m"


def failure(flight: FlightContext) -> str | None:
    """The sentence for the outcome, or None when everything was as expected."""
    failed = [wish.report for wish in flight.expectations if wish.report.met is False]
    if not failed:
        return None
    first = failed[0]
    more = f", and {len(failed) - 1} more" if len(failed) > 1 else ""
    return f"expectation of item {first.label} not met: {first.text} (was: {first.detail}){more}"


def _heard_of(hits: list[CollisionReport]) -> str:
    return ", ".join(f"hit at {hit.impact_speed_m_s:.2f} m/s" for hit in hits) or "no hit"


def _is_within(value: float, low: float | None, high: float | None) -> bool:
    return (low is None or value >= low) and (high is None or value <= high)


def _bounds(low: float | None, high: float | None, unit: str) -> str:
    least = "" if low is None else f" at least {low:g} {unit}".rstrip()
    most = "" if high is None else f" at most {high:g} {unit}".rstrip()
    return least + (" and" if least and most else "") + most
