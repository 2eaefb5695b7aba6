"""The simulated vehicle's body for a real PX4: a TCP server at `simulator_mavlink`'s port."""

import socket
import struct
import time
from collections.abc import Callable
from pathlib import Path

from sim_vehicle.hil.exchange import Exchange, ExchangePhase
from sim_vehicle.hil.vehicle import HilVehicle
from sim_vehicle.mavlink.decode import Decoder
from sim_vehicle.mavlink.encode import Encoder
from sim_vehicle.mavlink.hil import ANSWERS, SIMULATOR, answered, filled
from sim_vehicle.shell.ports import bound_socket
from sim_vehicle.shell.realtime import RealtimePace
from sim_vehicle.shell.truth_file import save_truth

PX4_SIMULATOR_PORT = 4560

# Ctrl-C and the clock are looked at this often while PX4 says nothing.
_LONGEST_WAIT_S = 0.1
_RECEIVE_BYTES = 65_536


def serve_px4(
    new_vehicle: Callable[[], HilVehicle],
    port: int = PX4_SIMULATOR_PORT,
    speed: float = 1.0,
    truth_path: Path | None = None,
    stop: Callable[[], bool] = lambda: False,
    tell: Callable[[str], None] = print,
    host: str = "127.0.0.1",
) -> None:
    """Give one PX4 after another a new vehicle until ``stop()``; ``tell`` gets sentences for a person.

    ``speed``: simulated seconds a second at most, 0 for as fast as PX4 answers. The truth of each PX4's
    vehicle is written when it goes. Raises PortInUse where ``port`` cannot be had at ``host``, and NotInLockstep.
    """
    with bound_socket(socket.SOCK_STREAM, host, port) as listener:
        listener.listen(1)
        listener.settimeout(_LONGEST_WAIT_S)
        tell(f"Waiting for PX4 at TCP port {listener.getsockname()[1]}.")
        while not stop():
            link = _accept(listener)
            if link is None:
                continue
            with link:
                session = _Session(new_vehicle(), link, speed, tell)
                try:
                    session.run(stop)
                finally:
                    session.end(truth_path)


class _Session:
    """One PX4 from connecting to going."""

    def __init__(self, vehicle: HilVehicle, link: socket.socket, speed: float, tell: Callable[[str], None]) -> None:
        self._vehicle = vehicle
        self._link = link
        self._tell = tell
        self._speed = speed
        self._pace = RealtimePace(vehicle.time_boot_us, speed)
        self._exchange = Exchange(_now_us())
        self._encoder, self._decoder = Encoder(SIMULATOR), Decoder(SIMULATOR, ANSWERS)
        self._lockstep_from: tuple[int, int] | None = None

    def run(self, stop: Callable[[], bool]) -> None:
        """Exchange samples and motor commands until PX4 goes or ``stop()``."""
        exchange = self._exchange
        self._tell("PX4 has connected.")
        while not stop():
            now_us = _now_us()
            exchange.look_at_clock(now_us)
            wait_us = self._send_if_due(now_us)
            try:
                data = self._receive(wait_us)
            except ConnectionError:
                return
            if data == b"":
                return
            for packet in self._decoder.push(data or b""):
                exchange.received(answered(packet))
            for notice in exchange.notices:
                self._tell(notice)
            exchange.notices.clear()

    def end(self, truth_path: Path | None) -> None:
        """Write the truth and say how it went."""
        now_us, time_us = _now_us(), self._vehicle.time_boot_us
        if self._lockstep_from is not None:
            wall_s, simulated_s = ((a - b) / 1e6 for a, b in zip((now_us, time_us), self._lockstep_from, strict=True))
            self._tell(f"PX4's flight ends after {simulated_s:.1f} s, flown in {wall_s:.1f} s.")
        else:
            self._tell("PX4 went away before it answered.")
        if truth_path is not None:
            save_truth(truth_path, self._vehicle.truth, self._pace.epoch_at_boot_us(), self._pace.stalls)

    def _send_if_due(self, now_us: int) -> int:
        """Send the next sample if it may go; how long, in microseconds, the vehicle's clock has to wait."""
        exchange, vehicle = self._exchange, self._vehicle
        allowed_us = exchange.next_sample_at_us()
        if allowed_us is None:
            return 0
        if exchange.phase is ExchangePhase.READY:
            if self._lockstep_from is None:
                # What PX4 took to boot is not caught up.
                self._lockstep_from = (now_us, vehicle.time_boot_us)
                self._pace = RealtimePace(vehicle.time_boot_us, self._speed)
            allowed_us = now_us + round(1e6 * self._pace.early_s(vehicle.time_boot_us + vehicle.interval_us))
        if allowed_us > now_us:
            return allowed_us - now_us
        messages = vehicle.step(exchange.motor_fractions)
        # PX4 that has gone is seen at the next receive.
        try:
            self._link.sendall(b"".join([self._encoder.packet(filled(message)) for message in messages]))
        except ConnectionError:
            return 0
        exchange.sent(vehicle.time_boot_us, now_us)
        return 0

    def _receive(self, wait_us: int) -> bytes | None:
        """What PX4 sent, b"" when it has gone, None when nothing came in time. An answer that is due is waited for."""
        is_awaited = self._exchange.phase is ExchangePhase.AWAITING
        if wait_us > 0:
            time.sleep(min(1e-6 * wait_us, _LONGEST_WAIT_S))
        try:
            return self._link.recv(_RECEIVE_BYTES, 0 if is_awaited else socket.MSG_DONTWAIT)
        except BlockingIOError:
            return None


def _now_us() -> int:
    return time.monotonic_ns() // 1000


def _accept(listener: socket.socket) -> socket.socket | None:
    try:
        link, _ = listener.accept()
    except TimeoutError:
        return None
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    # The kernel keeps the time, not Python: one call of the system for an answer instead of three.
    link.settimeout(None)
    link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("@ll", 0, round(1e6 * _LONGEST_WAIT_S)))
    return link
