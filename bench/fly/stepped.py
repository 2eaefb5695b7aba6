"""A vehicle and whoever flies or guards it, each on a link of its own, interval by interval, without a log."""

from companion.companion import Companion, StepResult
from companion.guard.guard import Guard
from rebound_cli.simulation.lockstep import EPOCH_US
from sim_vehicle.mavlink.streams.stream_rates import LinkKind
from sim_vehicle.vehicle import SimulatedVehicle


class Stepped:
    """All bytes both ways; what a program sends arrives with the next interval."""

    def __init__(self, vehicle: SimulatedVehicle, *programs: Companion | Guard) -> None:
        self.vehicle, self.programs = vehicle, programs
        self.links = [vehicle.add_link(LinkKind.ONBOARD) for _ in programs]

    @property
    def time_s(self) -> float:
        """Of the vehicle, since it was switched on."""
        return 1e-6 * self.vehicle.time_boot_us

    def step(self) -> list[StepResult]:
        """One interval; what each program made of it, where there was something to hear or to send."""
        self.vehicle.advance()
        now_us, results = EPOCH_US + self.vehicle.time_boot_us, []
        for program, link in zip(self.programs, self.links, strict=True):
            heard = b"".join(link.take())
            if heard or now_us >= program.next_deadline_us():
                result = program.step(heard, now_us)
                link.push(b"".join(result.sent_frames))
                results.append(result)
        return results

    def step_alone(self) -> bytes:
        """One interval in which nobody answers; what the vehicle said to the first."""
        self.vehicle.advance()
        return b"".join(self.links[0].take())
