"""Preflight: what the companion says of a vehicle's settings, streams and estimate, and the remedy it names."""

from dataclasses import replace

import pytest

from companion import messages
from companion.autopilot.setup import SerialLine, Verdict
from companion.messages import Attitude, LocalPosition, Parameter, ReadParameter, Sample, TimeSync
from companion.mission.config import CompanionConfig
from companion.preflight import Preflight, findings

PX4 = messages.Heartbeat(1, 1, 2, 12, False, 0, 3)
HEALTHY = {
    "COM_OF_LOSS_T": 0.3,
    "COM_OBL_RC_ACT": 4,
    "COM_RC_IN_MODE": 4,
    "COM_RCL_EXCEPT": 0,
    "CBRK_FLIGHTTERM": 121212,
    "IMU_INTEG_RATE": 250,
    "MPC_ACC_HOR": 2.0,
    "EKF2_EV_CTRL": 11,
    "EKF2_EVP_GATE": 50.0,
    "EKF2_ACC_NOISE": 1.0,
    "CA_ROTOR_COUNT": 4,
    # The paper's vehicle, its arms 0.145 m long, in PX4's order.
    **{f"CA_ROTOR{n}_PX": ahead * 0.1025 for n, ahead in enumerate((1, -1, 1, -1))},
    **{f"CA_ROTOR{n}_PY": right * 0.1025 for n, right in enumerate((1, -1, -1, 1))},
}
ON_TELEM2 = {
    "MAV_0_CONFIG": 101,
    "MAV_0_MODE": 0,
    "MAV_0_RATE": 1200,
    "MAV_0_FORWARD": 1,
    "MAV_2_CONFIG": 0,
    "MAV_1_CONFIG": 102,
    "MAV_1_MODE": 2,
    "MAV_1_RATE": 0,
    "MAV_1_FORWARD": 1,
    "SER_TEL1_BAUD": 57_600,
    "SER_TEL2_BAUD": 921_600,
}
UART = SerialLine(921_600)


def surveyed(
    parameters=HEALTHY,
    imu_hz=250,
    wander_m=0.0,
    ratio=0.1,
    trip_us=2_000,
    battery=90,
    clipped=0,
    velocity=True,
    line=None,
    held_us=0,
    flies=False,
    shakes_m_s2=0.0,
) -> Preflight:
    """A vehicle that was listened to for the whole time; its samples arrive in batches, every `held_us`."""
    survey = Preflight(CompanionConfig(), 0, line)
    survey.advance([PX4], 0)
    step_us, asked = 4_000, []
    held: list[Sample] = []
    for number in range(11_200_000 // step_us):
        now_us = (number + 1) * step_us
        samples: list[Sample] = []
        if number * imu_hz // 250 != (number + 1) * imu_hz // 250:
            side_m_s2 = shakes_m_s2 * (-1) ** number
            held.append(messages.ImuSample(now_us, (side_m_s2, 0.0, -9.81), (0.0, 0.0, 0.0)))
        if not held_us or number % (held_us // step_us) == 0:
            samples += held
            held = []
        if number % 5 == 0:
            north_m = wander_m if number % 2 else -wander_m
            samples += [LocalPosition(now_us, (north_m, 0.0, 0.0), (0.0, 0.0, 0.0)), Attitude(now_us, (1.0, 0, 0, 0))]
        if number % 250 == 0:
            samples += [messages.EstimatorStatus((ratio, ratio, ratio), velocity, False), messages.Battery(battery)]
            samples += [messages.Vibration(clipped * number)]
            samples += [Parameter(name, value) for name, value in parameters.items()]
            samples += [replace(PX4, armed=flies), messages.ExtendedState(messages.LandedState(2 if flies else 1))]
        if asked and now_us - asked[0] // 1000 >= trip_us:
            samples.append(TimeSync(asked.pop(0), 1))
        sent = survey.advance(samples, now_us)
        asked += [message.asked_ns for message in sent if isinstance(message, TimeSync)]
    assert survey.finished
    return survey


def verdicts(survey: Preflight) -> dict[str, Verdict]:
    return {finding.item: finding.verdict for finding in findings(survey)}


def found_in(survey: Preflight):
    return {finding.item: finding for finding in findings(survey)}


def test_a_healthy_vehicle_has_nothing_to_mend():
    assert set(verdicts(surveyed()).values()) == {Verdict.GOOD}
    on_a_line = verdicts(surveyed({**HEALTHY, **ON_TELEM2}, line=UART))
    assert set(on_a_line.values()) == {Verdict.GOOD} and {"port", "MAV_1_MODE", "arrival", "rotors"} <= set(on_a_line)


@pytest.mark.parametrize(
    ("changed", "line", "item", "remedy"),
    [
        ({"SER_TEL1_BAUD": 115_200, "SER_TEL2_BAUD": 0}, UART, "port", "MAV_1_CONFIG = 102"),
        ({"MAV_1_MODE": 0}, UART, "MAV_1_MODE", "MAV_1_MODE = 2, then reboot"),
        ({"MAV_1_RATE": 1200}, UART, "MAV_1_RATE", "MAV_1_RATE = 0, then reboot"),
        ({"MAV_1_FORWARD": 0}, UART, "MAV_1_FORWARD", "MAV_1_FORWARD = 1, then reboot"),
        # A radio's port, which is all that runs at this rate
        ({}, SerialLine(57_600), "port", "SER_TEL1_BAUD = 921600"),
        ({}, SerialLine(57_600), "MAV_0_MODE", "MAV_0_MODE = 2"),
        ({}, SerialLine(None), "port", "CBRK_USB_CHK = 197848"),
    ],
)
def test_the_port_at_the_end_of_the_line_is_named_with_what_is_wrong_with_it(changed, line, item, remedy):
    finding = found_in(surveyed({**HEALTHY, **ON_TELEM2, **changed}, line=line))[item]
    assert finding.verdict is Verdict.DOUBTFUL and remedy in finding.remedy


@pytest.mark.parametrize(("is_signed", "answers", "verdict"), [(1, 0, Verdict.BAD), (1, 1, None), (0, 0, None)])
def test_a_vehicle_that_signs_and_does_not_answer_wants_a_key(is_signed, answers, verdict):
    # Given a heartbeat of MAVLink 2, with a signature or without
    frame = bytes((0xFD, 0, is_signed, 0, 7, 1, 1, 0, 0, 0)) + bytes(15)
    survey = surveyed(HEALTHY if answers else {})
    survey.delivery.take(frame, (1, 1))
    assert verdicts(survey).get("signing") is verdict


def test_samples_that_are_held_back_are_told_with_the_timer_that_holds_them():
    # Given FTDI's 16 ms, in which four samples gather
    assert verdicts(surveyed())["arrival"] is Verdict.GOOD
    finding = found_in(surveyed(held_us=16_000))["arrival"]
    assert finding.verdict is Verdict.DOUBTFUL and "latency timer is 16 ms by default" in finding.remedy
    assert "differ by 12.0 ms" in finding.found
    # The driver's own word counts whatever was measured
    known = found_in(surveyed(line=SerialLine(921_600, 16), parameters={**HEALTHY, **ON_TELEM2}))["arrival"]
    assert known.verdict is Verdict.DOUBTFUL and "is 16 ms;" in known.remedy
    quick = surveyed(line=SerialLine(921_600, 1), parameters={**HEALTHY, **ON_TELEM2})
    assert verdicts(quick)["arrival"] is Verdict.GOOD


@pytest.mark.parametrize(
    ("changed", "verdict"),
    [
        ({"CA_ROTOR_COUNT": 6}, Verdict.DOUBTFUL),
        # A stretched frame, 10 cm from the guards' circle: a guard's radius is 8
        ({"CA_ROTOR0_PX": 0.2025}, Verdict.DOUBTFUL),
        ({"CA_ROTOR0_PX": 0.1525}, Verdict.GOOD),
        # A PX4 that does not know its rotors' places
        (None, None),
    ],
)
def test_rotors_that_are_elsewhere_than_the_guards_are_told(changed, verdict):
    known = {name: value for name, value in HEALTHY.items() if changed is not None or not name.startswith("CA_")}
    assert verdicts(surveyed({**known, **(changed or {})})).get("rotors") is verdict


def test_what_hovers_is_judged_by_how_it_shakes_and_not_by_how_it_wanders():
    hovering = found_in(surveyed(flies=True, wander_m=2.0, shakes_m_s2=1.0, clipped=3))
    assert "position" not in hovering and "shaking" not in hovering
    assert hovering["vibration"].verdict is Verdict.GOOD
    assert hovering["clipping"].verdict is Verdict.BAD and "hovering" in hovering["clipping"].found
    worn = found_in(surveyed(flies=True, shakes_m_s2=6.0))["vibration"]
    assert worn.verdict is Verdict.DOUBTFUL and "propellers" in worn.remedy


@pytest.mark.parametrize(
    ("changed", "verdict", "mended"),
    [
        ({"COM_OF_LOSS_T": 5.0}, Verdict.DOUBTFUL, 0.3),
        ({"COM_OBL_RC_ACT": 0}, Verdict.DOUBTFUL, 4),
        ({"COM_OBL_RC_ACT": 7}, Verdict.BAD, 4),
        ({"CBRK_FLIGHTTERM": 0}, Verdict.DOUBTFUL, 121212),
        ({"IMU_INTEG_RATE": 100}, Verdict.DOUBTFUL, 200),
        ({"IMU_INTEG_RATE": 0}, Verdict.DOUBTFUL, 200),
        ({"MPC_ACC_HOR": 3.0}, Verdict.DOUBTFUL, 2.0),
        ({"EKF2_EVP_GATE": 5.0}, Verdict.DOUBTFUL, 50.0),
        ({"EKF2_ACC_NOISE": 0.35}, Verdict.DOUBTFUL, 1.0),
        # A radio that may be lost is excepted, and the other exceptions stay
        ({"COM_RCL_EXCEPT": 1, "COM_RC_IN_MODE": 0}, Verdict.DOUBTFUL, 5),
    ],
)
def test_a_parameter_that_endangers_a_recovery_is_named_with_its_remedy(changed, verdict, mended):
    name = next(iter(changed))
    found = found_in(surveyed({**HEALTHY, **changed}))[name]
    assert found.verdict is verdict
    assert found.fix == (name, mended)
    assert f"{name} = {mended:g}" in found.remedy


def test_a_vehicle_that_does_not_fly_by_motion_capture_needs_no_room_for_it():
    outdoors = {**HEALTHY, "EKF2_EV_CTRL": 12, "EKF2_EVP_GATE": 5.0}
    assert "EKF2_EVP_GATE" not in found_in(surveyed(outdoors))


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


def test_the_time_in_which_a_person_reads_changes_nothing():
    survey = surveyed()
    before = verdicts(survey)
    survey.advance([messages.ImuSample(80_000_000, (0.0, 0.0, -9.81), (0.0, 0.0, 0.0))], 80_000_000)
    assert verdicts(survey) == before


def test_of_a_copter_the_lesser_imu_is_asked_for_too():
    survey = Preflight(CompanionConfig(), 0)
    sent = survey.advance([replace(PX4, autopilot=3)], 1_000_000)
    assert (27, 4000) in [message.command.parameters for message in sent if isinstance(message, messages.SendCommand)]


def test_what_the_vehicle_does_not_tell_is_asked_for_again_and_said():
    known = {name: value for name, value in HEALTHY.items() if name != "COM_OF_LOSS_T"}
    survey = surveyed(known)
    asked = {message.name for message in survey.advance([], 12_000_000) if isinstance(message, ReadParameter)}
    assert "COM_OF_LOSS_T" in asked and asked.isdisjoint(known)
    found = found_in(survey)["COM_OF_LOSS_T"]
    assert found.verdict is Verdict.DOUBTFUL and "did not tell" in found.found


def test_silence_is_told_after_the_stated_wait():
    survey = Preflight(CompanionConfig(), 0)
    survey.advance([replace(PX4, component_id=190, armed=True)], 9_900_000)
    assert not survey.finished and survey.vehicle.armed is None, "a ground station's heartbeat"
    survey.advance([], 10_100_000)
    assert survey.finished
    assert "no PX4" in (survey.refusal or "")
