"""What a bad link between the vehicle and the companion leaves: later, in another order, or not at all."""

from collections.abc import Sequence
from typing import Final

from bench.detectors.recording import VehicleRecording
from bench.detectors.wire import HeardStep
from companion.messages import Sample
from sim_vehicle.faults.spec import WireFault
from sim_vehicle.faults.wire import Wire

# Wi-Fi with others on the channel: up to 10 ms of waiting for the air, now and then a packet gone or overtaken.
JITTERY: Final = "jitter 10 ms, 1 % lost, 1 % overtaken"
LINKS: dict[str, WireFault] = {
    JITTERY: WireFault(kind="wire", at_s=0.0, jitter_s=0.01, loss=0.01, reorder=0.01),
}
# The companion hears a packet when it arrives; finer than an IMU interval of 4 ms, or latencies came in steps of it.
LOOK_EVERY_US = 1000
_NUMBER_BYTES = 4


def over_link(sent: Sequence[HeardStep], recording: VehicleRecording, fault: WireFault, seed: int) -> list[HeardStep]:
    """What arrives, and when, of the samples that were sent: each message a packet of its own.

    `index` is the interval of the arrival, whose situation the companion knows then.
    """
    wire = Wire([fault], seed)
    packets: list[Sample] = []
    sent_at = {step.index: step.samples for step in sent}
    arrived: list[HeardStep] = []
    times_us = [sample.time_boot_us for sample in recording.samples]
    ends_us = [*times_us[1:], times_us[-1] + LOOK_EVERY_US]
    for index, (begins_us, end_us) in enumerate(zip(times_us, ends_us, strict=True)):
        frames = []
        for sample in sent_at.get(index, ()):
            frames.append(len(packets).to_bytes(_NUMBER_BYTES, "little"))
            packets.append(sample)
        for now_us in range(begins_us, end_us, LOOK_EVERY_US):
            numbers = wire.carry(frames, now_us)
            frames = []
            if numbers:
                samples = tuple(packets[int.from_bytes(number, "little")] for number in numbers)
                arrived.append(HeardStep(index, now_us, samples))
    return arrived
