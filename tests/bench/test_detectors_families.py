"""The bench's hits over a bad link, struck hovers and hands: what is flown, what arrives, and the verdicts."""

import math

import pytest

from bench.cases.hits import draw_case, draw_hand, vehicle_of_hit
from bench.fly.cruise import fly_hit, hover_in_hand
from bench.fly.watching import streams_asked_hz
from bench.fly.wire import JITTERY, LINKS, heard
from bench.rows.heard import first_possible, work_out_hand, work_out_hit
from companion.messages import ImuSample
from sim_vehicle.airframe import load_built_in

# --- a bad link -------------------------------------------------------------------------------------------------------


def sent_and_arrived(fault, seed=4):
    case = draw_case("link", 0, ())
    recording, hit = fly_hit(case, vehicle_of_hit(case).airframe)
    sent, arrived = (heard(recording, streams_asked_hz(246), seed, one) for one in (None, fault))
    return recording, hit, sent, arrived


def imu_stamps(heard):
    return [s.time_boot_us for step in heard for s in step.samples if isinstance(s, ImuSample)]


def test_a_bad_link_delays_loses_and_reorders_and_adds_nothing():
    # Given what a vehicle sent, over a link with jitter, loss and packets that are overtaken
    recording, _, sent, arrived = sent_and_arrived(LINKS[JITTERY])
    before, after = imu_stamps(sent), imu_stamps(arrived)
    # Then about one in a hundred is missing, what comes is what was sent, some of it after its followers
    assert 0.0 < 1.0 - len(after) / len(before) < 0.04
    assert set(after) < set(before) and len(set(after)) == len(after)
    assert after != sorted(after)
    # And nothing comes before it was sent, or later than jitter and overtaking can make it
    late_us = [step.time_boot_us - s.time_boot_us for step in arrived for s in step.samples if isinstance(s, ImuSample)]
    assert min(late_us) >= 0 and 8_000 < max(late_us) <= 31_000
    # And each arrival is in the interval whose situation the companion knows by then
    assert all(recording.samples[step.index].time_boot_us <= step.time_boot_us for step in arrived)
    # And the same seed loses the same
    assert sent_and_arrived(LINKS[JITTERY])[3] == arrived


def test_a_link_that_only_delays_shows_the_hit_by_so_much_later():
    # Given a link on which everything takes 50 ms
    fault = LINKS[JITTERY].model_copy(update={"jitter_s": 0.0, "loss": 0.0, "reorder": 0.0, "delay_s": 0.05})
    recording, hit, sent, arrived = sent_and_arrived(fault)
    touch_us = hit.contact_at_boot_us
    # Then the first sample that shows the hit is the same one, heard 50 ms later, to the millisecond
    direct = first_possible(recording, sent, touch_us, 1.5).time_boot_us
    delayed = first_possible(recording, arrived, touch_us, 1.5).time_boot_us
    assert 50_000 <= delayed - direct <= 51_000


# --- struck in hover --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_an_obstacle_strikes_a_vehicle_that_hovers(seed):
    # Given an obstacle of any kind that comes at a hovering vehicle
    case = draw_case("struck", seed, (), is_struck=True)
    _, hit = fly_hit(case, vehicle_of_hit(case).airframe)
    # Then it is the obstacle that moves, at the speed asked for, and it meets the vehicle head-on or at a slant
    assert 0.5 <= case.speed_m_s <= 3.0
    assert math.hypot(*hit.impact_velocity_ned_m_s) < 0.15
    assert math.hypot(*hit.surface_velocity_ned_m_s) == pytest.approx(case.speed_m_s, rel=0.01)
    assert sum(v * n for v, n in zip(hit.surface_velocity_ned_m_s, hit.normal_ned, strict=True)) > 0.0


# --- hands ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [0, 2])
def test_a_hand_holds_or_pushes_a_hovering_vehicle(seed):
    # Given a hand that holds (first) or pushes (second)
    case = draw_hand(seed, ())
    recording, began_us = hover_in_hand(case, load_built_in(case.airframe))
    samples = recording.samples
    moved_m = [math.dist(s.position_ned_m, (0.0, 0.0, -30.0)) for s in samples if s.time_boot_us < began_us]
    # Then it hovered until then, and nothing of it is an obstacle
    assert samples[-1].time_boot_us > began_us + 0.8e6 and max(moved_m) < 0.3
    assert not any(recording.contact_m_s2)
    # And the push is felt sideways
    felt = max(math.hypot(*s.specific_force_frd_m_s2[:2]) for s in samples if s.time_boot_us > began_us)
    assert felt > 1.5 if case.grip == "pushed" else felt < 8.0


# --- verdicts ---------------------------------------------------------------------------------------------------------


def test_the_default_detector_finds_them_and_lets_hands_be():
    # Given a hit over a bad link, an obstacle that comes, and a hand
    for settings in ({"link": JITTERY}, {"is_struck": True}):
        scored = work_out_hit(draw_case("any", 1, ("fused",), **settings))
        # Then the hits are found at every rate, with no alarm before, and the hand is no collision
        for at_rate in scored["rates"].values():
            assert "latency_ms" in at_rate["detectors"]["fused"] and at_rate["detectors"]["fused"]["false"] == 0
    for at_rate in work_out_hand(draw_hand(6, ("fused",)))["rates"].values():
        entry = at_rate["detectors"]["fused"]
        assert entry["collisions"] == [] and entry["told_after_ms"] is not None


def test_the_echo_of_a_stiff_hit_does_not_turn_the_obstacle_round():
    # Given a rigid frame's head-on hit of 2.7 m/s that fell between the samples of 50 Hz but for a faint echo
    scored = work_out_hit(draw_case("plain", 11, ("fused",)))
    fused = scored["rates"]["50"]["detectors"]["fused"]
    # Then it is found, and the normal is that of something in the vehicle's way, whatever the echo would explain
    assert scored["off_head_on_deg"] < 5.0
    assert fused["normal_error_deg"] < 45.0
