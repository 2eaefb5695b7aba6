"""The detectors' bench: its short cut past the autopilot, its truth, its verdicts, its command."""

import pandas as pd
import pytest

from bench.cases.hits import draw_case, vehicle_of_hit
from bench.fly.wire import ASKED_HZ, VehicleRecording, fly_hit, heard, streams_asked_hz
from bench.main import main
from bench.studies.detectors import first_possible, samples_late, work_out_hit
from companion.mavlink.decode import Decoder
from companion.messages import ExtendedState
from companion.reflex.detector import Situation
from sim_vehicle.plant.plant import Plant
from tests.sim_vehicle.vehicle_client import ARM_DISARM, SET_INTERVAL, TAKEOFF, Client


@pytest.mark.parametrize("rate", ASKED_HZ)
def test_the_samples_of_a_recording_are_those_of_the_whole_vehicle(rate, monkeypatch):
    # Given a vehicle that takes off, whose link was asked for the bench's rates before anything else
    recording, seed = VehicleRecording(), 11 + rate
    step = Plant.step

    def recorded_step(plant, setpoint, armed):
        output = step(plant, setpoint, armed)
        recording.add(plant, output, Situation(), 1.0)
        return output

    monkeypatch.setattr(Plant, "step", recorded_step)
    # Another plant stands on the ground before there is a vehicle.
    monkeypatch.setattr("sim_vehicle.vehicle.check_start", lambda *_: None)
    client = Client(seed)
    asked_hz = streams_asked_hz(rate)
    for message, hz in asked_hz.items():
        client.command(SET_INTERVAL, message, 1e6 / hz)
    client.run(0.2)
    client.command(TAKEOFF)
    client.command(ARM_DISARM, 1)
    client.run(6.0)
    assert client.position()[2] < -1.5
    # When its packets are decoded as the companion does it
    decoder = Decoder()
    decoder.listen_to(1, 1)
    made = [sample for step in heard(recording, asked_hz, seed) for sample in step.samples]
    kinds = {type(sample) for sample in made}
    decoded = [sample for raw in client.packets for _, sample in decoder.feed(raw) if type(sample) in kinds]
    # Then they are, bit by bit and in this order, what the bench makes of the recording
    # A receiver shows no hit: no detector hears it.
    assert len(made) > 6 * rate and len(kinds) == len(asked_hz) - 1
    assert without_landed_state(decoded) == without_landed_state(made)


def without_landed_state(samples):
    """The bench's flights know their own landed state; here it is only when it comes that counts."""
    return [ExtendedState if isinstance(sample, ExtendedState) else sample for sample in samples]


@pytest.mark.parametrize("seed", range(10))
def test_a_hit_is_the_one_that_was_asked_for(seed):
    # Given any approach
    case = draw_case(seed, False)
    airframe = vehicle_of_hit(case).airframe
    # When it is flown
    recording, hit = fly_hit(case, airframe)
    # Then the vehicle touches at the speed asked for, moving towards the obstacle
    speed_m_s = sum(v * v for v in hit.impact_velocity_ned_m_s) ** 0.5
    assert speed_m_s == pytest.approx(case.speed_m_s, rel=0.1, abs=0.1)
    # And the recorded contact force adds up to the hit's impulse, and there is none before it
    before = [
        force
        for sample, force in zip(recording.samples, recording.contact_m_s2, strict=True)
        if sample.time_boot_us < hit.contact_at_boot_us
    ]
    assert before and not any(before)
    total_m_s = sum(recording.contact_m_s2) * 1e-6 * airframe.imu.integration_interval_us
    assert total_m_s >= 0.95 * sum(j * j for j in hit.impulse_ned_n_s) ** 0.5 / airframe.mass_kg


def test_the_first_possible_sample_is_the_first_received_that_holds_the_force():
    # Given a hit, heard at every rate
    case = draw_case(0, False)
    recording, hit = fly_hit(case, vehicle_of_hit(case).airframe)
    first_us = {}
    for rate in ASKED_HZ:
        arrived = heard(recording, streams_asked_hz(rate), case.seed)
        first_us[rate], times_us = first_possible(recording, arrived, hit.contact_at_boot_us, floor_m_s2=1.5)
        # Then the report that came with it was not late, and one with the next sample was late by one
        after_us = next(time_us for time_us in times_us if time_us > first_us[rate])
        late = [samples_late(at_us, first_us[rate], times_us) for at_us in (first_us[rate], after_us)]
        assert late == [0, 1] and first_us[rate] > hit.contact_at_boot_us
    # And slower streams show it later or at the same time, up to an interval of the stream
    assert first_us[246] - hit.contact_at_boot_us <= 8_000
    assert first_us[50] - hit.contact_at_boot_us <= 24_000
    # And where no force reaches the floor, the hit fell between the samples
    assert first_possible(recording, arrived, hit.contact_at_boot_us, floor_m_s2=1e6)[0] is None


def test_the_default_detector_finds_a_hit_at_every_rate_with_no_alarm_before_it():
    rows = [row for row in work_out_hit(draw_case(1, False))["rows"] if row["detector"] == "fused"]
    assert len(rows) == len(ASKED_HZ)
    for row in rows:
        assert row["latency_ms"] is not None and row["false"] == 0


@pytest.mark.slow
def test_the_command_writes_tables_and_rows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["detectors", "--hits", "4", "--jobs", "1", "--out", "page"]) == 0
    text = (tmp_path / "page" / "detectors.md").read_text()
    assert "`python -m bench detectors --hits 4 --jobs 1 --out page`" in text
    assert "## Every detector on simulated hits" in text and "bars are met" in capsys.readouterr().out
    table = pd.read_json(tmp_path / "page" / "detectors.jsonl", lines=True)
    assert {*table["detector"]} >= {"fused", "threshold"} and {*table["rate"]} == {*ASKED_HZ}
