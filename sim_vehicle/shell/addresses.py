"""Ports from addresses in MAVSDK's convention, seen from the vehicle, and PX4's own two UDP links.

udpout://127.0.0.1:14550          sends to this address, unasked
udpin://0.0.0.0:14551             waits for clients, as many as come
tcpin://0.0.0.0:5760              the same on TCP
serial:///dev/ttyUSB0:57600       a serial line

With `?set=onboard`, `normal` or `ground` at the end: whose streams it begins with.
"""

import re
from contextlib import ExitStack, closing

from sim_vehicle.errors import LinkAddressError
from sim_vehicle.mavlink.streams.stream_rates import LinkKind, link_kind
from sim_vehicle.shell.ports import Address, Port, SerialPort, TcpServerPort, UdpPeerPort, UdpServerPort
from sim_vehicle.vehicle import SimulatedVehicle

# Where PX4's SITL listens and sends unasked, plus its instance: a companion's link and a ground station's.
COMPANION_LISTEN_PORT, COMPANION_PORT = 14580, 14540
GROUND_LISTEN_PORT, GROUND_PORT = 18570, 14550

_ADDRESS = re.compile(r"(?P<scheme>\w+)://(?P<where>[^?]+):(?P<number>[0-9]+)(\?set=(?P<set>\w+))?")
_HIGHEST_PORT = 65_535
_FORMS = "udpout://HOST:PORT, udpin://HOST:PORT, tcpin://HOST:PORT or serial:///dev/PORT:BAUD"


def open_port(vehicle: SimulatedVehicle, address: str) -> Port:
    """The port at ``address``. Raises LinkAddressError for one that is none, PortInUse for one that cannot be had."""
    found = _ADDRESS.fullmatch(address)
    if found is None:
        raise LinkAddressError(f"{address!r} is not an address of a link: use {_FORMS}.")
    scheme, where, number = found["scheme"], found["where"], int(found["number"])
    try:
        kind = link_kind(found["set"] or ("onboard" if scheme == "serial" else "ground"))
    except LinkAddressError as problem:
        raise LinkAddressError(f"{address!r}: {problem}") from problem
    if scheme == "serial":
        return SerialPort(vehicle, kind, where, number)
    if number > _HIGHEST_PORT:
        raise LinkAddressError(f"{address!r} names no port: give one from 0 to {_HIGHEST_PORT}.")
    if scheme == "udpout":
        return UdpPeerPort(vehicle, kind, 0, (where, number))
    if scheme == "udpin":
        return UdpServerPort(vehicle, kind, where, number)
    if scheme == "tcpin":
        return TcpServerPort(vehicle, kind, where, number)
    raise LinkAddressError(f"{address!r} begins with an unknown scheme {scheme!r}: use {_FORMS}.")


def px4_ports(
    vehicle: SimulatedVehicle, instance: int, listen_port: int | None = None, companion: Address | None = None
) -> list[Port]:
    """PX4's two UDP links: to a companion and to a ground station on this machine.

    ``listen_port`` 0: both listen wherever there is room.
    """
    onboard, ground = LinkKind.ONBOARD, LinkKind.GROUND
    ground_listen_port = 0 if listen_port == 0 else GROUND_LISTEN_PORT + instance
    listen_port = COMPANION_LISTEN_PORT + instance if listen_port is None else listen_port
    companion = companion or ("127.0.0.1", COMPANION_PORT + instance)
    with ExitStack() as opened:
        # What has been opened before one that cannot be had is closed again.
        first = opened.enter_context(closing(UdpPeerPort(vehicle, onboard, listen_port, companion)))
        second = UdpPeerPort(vehicle, ground, ground_listen_port, ("127.0.0.1", GROUND_PORT))
        opened.pop_all()
    return [first, second]
