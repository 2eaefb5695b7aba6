"""The simulated vehicle: MAVLink bytes in, one interval of flight, MAVLink bytes out."""

from sim_vehicle.airframe import Airframe
from sim_vehicle.autopilot import commands
from sim_vehicle.autopilot.autopilot import POSITION_PERIOD_US, Autopilot
from sim_vehicle.autopilot.messages import Command, PeerHeartbeat, PositionTarget, Received
from sim_vehicle.mavlink import encode
from sim_vehicle.mavlink.decode import Decoder
from sim_vehicle.mavlink.encode import Encoder, Telemetry
from sim_vehicle.mavlink.streams import Streams
from sim_vehicle.mavlink.texts import TextLink
from sim_vehicle.mavlink.vibration import Vibration
from sim_vehicle.physics.plant import Plant, PlantOutput
from sim_vehicle.scene import Scene, check_start_is_free
from sim_vehicle.setpoint import TrajectorySetpoint
from sim_vehicle.truth import TruthRecorder


class SimulatedVehicle:
    """Airframe, world and seed in; the same bytes in give the same bytes out."""

    def __init__(self, airframe: Airframe, scene: Scene, seed: int, keeps_path: bool = True) -> None:
        """``keeps_path`` off: the truth holds the hits but no path, for a simulation without an end.

        Raises SceneError where a wall passes through the start position.
        """
        check_start_is_free(scene, airframe)
        self._plant = Plant(airframe, scene, seed, keeps_path)
        # A first interval at rest: a vehicle that can be talked to has already seen its sensors.
        first = self._plant.step(None, armed=False)
        self._autopilot = Autopilot(airframe.hover_fraction, first)
        self._telemetry = Telemetry(
            sample=first,
            published=first,
            autopilot=self._autopilot,
            vibration=Vibration(),
            position_variance_m2=airframe.estimate.position_noise_m**2,
            velocity_variance_m2_s2=airframe.estimate.velocity_noise_m_s**2,
            attitude_variance_rad2=airframe.estimate.attitude_noise_rad**2,
            true_body=self._plant.state.body,
        )
        self._decoder = Decoder()
        self._streams = Streams(self._telemetry, Encoder(), seed)
        self._texts = TextLink()
        self.interval_us = self._plant.interval_us
        self.time_boot_us = first.time_boot_us

    @property
    def truth(self) -> TruthRecorder:
        """What really happened, never sent."""
        return self._plant.truth

    def step(self, received: bytes) -> tuple[bytes, ...]:
        """Apply the bytes received since the last step, advance one interval, return the packets to send."""
        self._acknowledge_last_commands()
        for message in self._decoder.push(received):
            self._receive(message)
        setpoint = self._autopilot.run_control()
        sample = self._fly(setpoint)
        self._send_texts()
        self._streams.update(new_position=self._publish(sample))
        return self._streams.take()

    def _acknowledge_last_commands(self) -> None:
        """The commander runs beside the receiver: it answers in the interval after a command came."""
        for ack in self._autopilot.run_commander():
            self._streams.send(encode.command_ack(ack))

    def _receive(self, message: Received) -> None:
        if isinstance(message, PositionTarget):
            self._autopilot.setpoint(message)
        elif isinstance(message, Command):
            self._receive_command(message)
        elif isinstance(message, PeerHeartbeat):
            self._texts.heard(message, self.time_boot_us)
        else:
            # Bytes arrive anywhere in the interval since the last sample: on average in its middle.
            heard_at_us = self.time_boot_us + self.interval_us // 2
            self._streams.send(encode.timesync_reply(message, heard_at_us))

    def _receive_command(self, command: Command) -> None:
        if not commands.is_for_us(command):
            return
        result, is_for_commander = commands.receive(command, self._streams)
        if result is not None:
            self._streams.send(encode.command_ack(commands.answer(command, result)))
        if is_for_commander:
            self._autopilot.command(command)

    def _fly(self, setpoint: TrajectorySetpoint | None) -> PlantOutput:
        sample = self._plant.step(setpoint, self._autopilot.arming.armed)
        self._autopilot.observe(sample)
        self.time_boot_us = sample.time_boot_us
        return sample

    def _publish(self, sample: PlantOutput) -> bool:
        """Hand the sample to the streams; whether position and velocity are published with it."""
        telemetry = self._telemetry
        telemetry.sample = sample
        onboard = self._plant.onboard
        if onboard is not None:
            telemetry.flow, telemetry.range = onboard.flow, onboard.range
        telemetry.vibration.update(sample.specific_force_frd_m_s2, sample.angular_velocity_frd_rad_s)
        if sample.time_boot_us - telemetry.published.time_boot_us < POSITION_PERIOD_US:
            return False
        telemetry.published = sample
        if onboard is not None:
            position, velocity, attitude = onboard.variances()
            telemetry.position_variance_m2, telemetry.velocity_variance_m2_s2 = position, velocity
            telemetry.attitude_variance_rad2 = attitude
        return True

    def _send_texts(self) -> None:
        texts = self._autopilot.texts
        for text in texts:
            self._texts.add(text, self.time_boot_us)
        texts.clear()
        for message in self._texts.due(self.time_boot_us):
            self._streams.send(message)
