"""Preflight: what the companion says of a vehicle's settings, streams and estimate, and the remedy it names."""

import pytest

from companion.messages import (
    Attitude,
    Battery,
    EstimatorStatus,
    Heartbeat,
    ImuSample,
    LocalPosition,
    Parameter,
    ReadParameter,
    Sample,
    TimeSyncAnswer,
    TimeSyncAsk,
    Vibration,
)
from companion.mission.config import CompanionConfig
from companion.preflight import PARAMETERS, Survey, Verdict, advance, findings, start_survey

PX4 = Heartbeat(1, 1, 2, 12, False, 0, 3)
HEALTHY = {
    "COM_OF_LOSS_T": 1.0,
    "COM_OBL_RC_ACT": 4,
    "COM_RC_IN_MODE": 4,
    "COM_RCL_EXCEPT": 0,
    "CBRK_FLIGHTTERM": 121212,
    "IMU_INTEG_RATE": 250,
    "MPC_ACC_HOR": 2.0,
}


def surveyed(
    parameters=HEALTHY, imu_hz=250, wander_m=0.0, ratio=0.1, trip_us=2_000, battery=90, clipped=0, velocity=True
) -> Survey:
    """A vehicle that was listened to for the whole time."""
    survey = start_survey(CompanionConfig(), 0)
    advance(survey, [PX4], 0)
    step_us, asked = 4_000, []
    for number in range(11_200_000 // step_us):
        now_us = (number + 1) * step_us
        samples: list[Sample] = []
        if number * imu_hz // 250 != (number + 1) * imu_hz // 250:
            samples.append(ImuSample(now_us, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0)))
        if number % 5 == 0:
            north_m = wander_m if number % 2 else -wander_m
            samples += [LocalPosition(now_us, (north_m, 0.0, 0.0), (0.0, 0.0, 0.0)), Attitude(now_us, (1.0, 0, 0, 0))]
        if number % 250 == 0:
            samples += [EstimatorStatus((ratio, ratio, ratio), velocity, False), Battery(battery)]
            samples += [Vibration(now_us, 0.0, 0.0, (clipped * number, 0, 0))]
            samples += [Parameter(name, value) for name, value in parameters.items()]
        if asked and now_us - asked[0] // 1000 >= trip_us:
            samples.append(TimeSyncAnswer(asked.pop(0), 1))
        sent = advance(survey, samples, now_us)
        asked += [message.companion_time_ns for message in sent if isinstance(message, TimeSyncAsk)]
    assert survey.finished
    return survey


def verdicts(survey: Survey) -> dict[str, Verdict]:
    return {finding.item: finding.verdict for finding in findings(survey)}


def test_a_healthy_vehicle_has_nothing_to_mend():
    assert set(verdicts(surveyed()).values()) == {Verdict.GOOD}


@pytest.mark.parametrize(
    ("name", "value", "verdict", "mended"),
    [
        ("COM_OF_LOSS_T", 5.0, Verdict.DOUBTFUL, 1.0),
        ("COM_OBL_RC_ACT", 0, Verdict.DOUBTFUL, 4),
        ("COM_OBL_RC_ACT", 7, Verdict.BAD, 4),
        ("CBRK_FLIGHTTERM", 0, Verdict.DOUBTFUL, 121212),
        ("IMU_INTEG_RATE", 100, Verdict.DOUBTFUL, 200),
        ("MPC_ACC_HOR", 3.0, Verdict.DOUBTFUL, 2.0),
    ],
)
def test_a_parameter_that_endangers_a_recovery_is_named_with_its_remedy(name, value, verdict, mended):
    found = {finding.item: finding for finding in findings(surveyed({**HEALTHY, name: value}))}[name]
    assert found.verdict is verdict
    assert found.fix == (name, mended)
    assert f"{name} = {mended:g}" in found.remedy


def test_a_radio_that_may_be_lost_is_excepted_and_the_other_exceptions_stay():
    settings = {**HEALTHY, "COM_RC_IN_MODE": 0, "COM_RCL_EXCEPT": 1}
    found = {finding.item: finding for finding in findings(surveyed(settings))}["COM_RCL_EXCEPT"]
    assert found.fix == ("COM_RCL_EXCEPT", 5)


@pytest.mark.parametrize(
    ("wrong", "item", "verdict"),
    [
        ({"imu_hz": 30}, "HIGHRES_IMU", Verdict.BAD),
        ({"imu_hz": 50}, "HIGHRES_IMU", Verdict.DOUBTFUL),
        ({"imu_hz": 50}, "smallest hit", Verdict.DOUBTFUL),
        ({"wander_m": 0.3}, "position", Verdict.DOUBTFUL),
        ({"wander_m": 0.8}, "position", Verdict.BAD),
        ({"ratio": 0.7}, "estimator", Verdict.DOUBTFUL),
        ({"ratio": 1.2}, "estimator", Verdict.BAD),
        ({"velocity": False}, "estimator", Verdict.BAD),
        ({"trip_us": 40_000}, "time", Verdict.DOUBTFUL),
        ({"trip_us": 200_000}, "time", Verdict.BAD),
        ({"battery": 30}, "battery", Verdict.DOUBTFUL),
        ({"battery": 10}, "battery", Verdict.BAD),
        ({"clipped": 3}, "clipping", Verdict.BAD),
    ],
)
def test_what_is_measured_is_judged(wrong, item, verdict):
    assert verdicts(surveyed(**wrong))[item] is verdict


def test_answers_that_nobody_asked_for_make_no_round_trip():
    # Given a vehicle that answers in 200 ms, and a program beside whose answers come by
    survey = start_survey(CompanionConfig(), 0)
    advance(survey, [PX4], 0)
    for now_us in range(50_000, 3_000_000, 50_000):
        advance(survey, [TimeSyncAnswer(1000 * (now_us - 1_777), 1)], now_us)
    # Then nothing is known of ours
    found = {finding.item: finding for finding in findings(survey)}["time"]
    assert (found.verdict, found.found) == (Verdict.DOUBTFUL, "TIMESYNC is not answered")


def test_arms_that_are_no_quad_x_are_worth_a_look_where_the_normal_is_fitted_to_them():
    def frame(kind, **estimate):
        survey = start_survey(CompanionConfig(estimate=estimate), 0)
        advance(survey, [Heartbeat(1, 1, kind, 12, False, 0, 3)], 0)
        return verdicts(survey)["frame"]

    arms = {"travel_m": 0.03}
    assert frame(2, guards=arms) is Verdict.GOOD
    assert frame(13, guards=arms) is Verdict.DOUBTFUL
    assert frame(13, guards=arms, fits_normal=False) is Verdict.GOOD
    assert frame(13) is Verdict.GOOD, "no arm folds"


def test_what_the_vehicle_does_not_tell_is_asked_for_again_and_said():
    known = {name: value for name, value in HEALTHY.items() if name != "COM_OF_LOSS_T"}
    survey = surveyed(known)
    asked = [message for message in advance(survey, [], 12_000_000) if isinstance(message, ReadParameter)]
    assert asked == [ReadParameter("COM_OF_LOSS_T")]
    assert verdicts(survey)["COM_OF_LOSS_T"] is Verdict.DOUBTFUL


def test_all_questions_are_asked_at_once():
    survey = start_survey(CompanionConfig(), 0)
    asked = {message.name for message in advance(survey, [PX4], 0) if isinstance(message, ReadParameter)}
    assert asked == set(PARAMETERS)


def test_silence_is_told_after_the_stated_wait():
    survey = start_survey(CompanionConfig(), 0)
    advance(survey, [], 9_900_000)
    assert not survey.finished
    advance(survey, [], 10_100_000)
    assert survey.finished
    assert "no PX4" in (survey.refusal or "")


def test_an_autopilot_that_is_not_px4_is_refused():
    survey = start_survey(CompanionConfig(), 0)
    advance(survey, [Heartbeat(1, 1, 2, 3, False, 0, 3)], 0)
    assert survey.finished
    assert "ArduPilot" in (survey.refusal or "")
