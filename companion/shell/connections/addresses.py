"""Connection addresses, in MAVSDK's convention, turned into connections.

udpin://0.0.0.0:14540            listen, and answer the vehicle that speaks there (see peer.py)
udpout://192.168.1.20:14580      send first, to this address, and hear nobody else
tcpout://127.0.0.1:5760          connect to a server
tcpin://0.0.0.0:5760             wait for one client
serial:///dev/ttyAMA0:921600     serial port and baud rate
udp://:14540                     the older form of udpin (or of udpout when a remote host is given)
"""

import ipaddress
import re
import socket
from typing import Any, NamedTuple, TypeAlias

from companion.errors import AddressError
from companion.mavlink.signing import Signing
from companion.shell.connections.connection import ANY_HOST, UdpConnection, resolve, udp_in
from companion.shell.connections.peer import Peer
from companion.shell.connections.streams import SerialConnection, StreamConnection, TcpInConnection, tcp_out

# To a vehicle. Both have a descriptor, None while there is nothing that bytes could come from.
Opened: TypeAlias = UdpConnection | StreamConnection

_HOST_PORT = re.compile(r"^(?P<host>\[[0-9a-fA-F:]+\]|[^:/\[\]]*):(?P<port>\d{1,5})$")
_MOST_PORT = 65_535  # 16 bits
MOST_BAUD = 20_000_000  # no UART of a flight controller is faster
_SCHEMES = ("udpin", "udpout", "tcpout", "tcpin", "serial", "udp")
_FORMS = "udpin://HOST:PORT, udpout://HOST:PORT, tcpout://HOST:PORT, tcpin://HOST:PORT or serial:///dev/PORT:BAUD"


class Endpoint(NamedTuple):
    """Of a serial port `host` is the device and `port` the baud rate."""

    url: str
    scheme: str
    host: str
    port: int


def open_connection(url: str, peer: str | None = None, signing: Signing | None = None, waits: bool = False) -> Opened:
    """Open the address; `peer`, HOST or HOST:PORT, is the only one heard on udpin, and only genuine packets pin it.

    `waits`: a port that is not there, or a server that does not answer, is looked for until it is.
    Raises ConnectionSetupError with one clear sentence.
    """
    _, scheme, host, port = address = parsed(url)
    if peer is not None and scheme != "udpin":
        raise AddressError(f"--peer {peer} is for udpin://; {url!r} names its peer itself.")
    match scheme:
        case "serial":
            return SerialConnection(host, port, waits)
        case "udpin":
            return udp_in(host, port, Peer(None if peer is None else _peer(peer, host), signing))
        case "tcpin":
            return TcpInConnection(host, port)
    family, remote = one_host(address)
    if scheme == "tcpout":
        return tcp_out(host, port, waits)
    # Whoever listens there with one socket, as PX4, mavlink-router, MAVSDK and mavutil do, answers from that port.
    return UdpConnection(socket.socket(family, socket.SOCK_DGRAM), Peer(remote[:2]), remote)


def parsed(url: str) -> Endpoint:
    """Nothing is opened, and no name looked up. Raises AddressError."""
    scheme, separator, rest = url.partition("://")
    if not separator:
        raise AddressError(f"{url!r} is not a connection address: use {_FORMS}.")
    if scheme not in _SCHEMES:
        raise AddressError(f"{url!r} begins with an unknown scheme {scheme!r}: use {_FORMS}.")
    if scheme == "serial":
        device, _, baud = rest.rpartition(":")
        if not device or not baud.isdecimal() or not 0 < int(baud) <= MOST_BAUD:
            raise AddressError(f"{url!r} names no device and baud rate: use serial:///dev/ttyAMA0:921600.")
        return Endpoint(url, scheme, device, int(baud))
    match = _HOST_PORT.match(rest)
    if match is None:
        raise AddressError(f"{url!r} names no host and port: use {_FORMS}.")
    host, port = match["host"], int(match["port"])
    if port > _MOST_PORT:
        raise AddressError(f"{url!r}: there is no port {port}, the last is {_MOST_PORT}.")
    if scheme == "udp":
        scheme = "udpin" if host in ("", "0.0.0.0", "[::]") else "udpout"
    return Endpoint(url, scheme, host, port)


def one_host(remote: Endpoint) -> tuple[socket.AddressFamily, Any]:
    """Its family and address. Only who answers from the address that was sent to is ever heard."""
    url, scheme, host, port = remote
    if not host or port == 0:
        raise AddressError(f"{url!r} names no remote host and port: use {scheme}://HOST:PORT.")
    family, address = resolve(host, port)
    number = ipaddress.ip_address(address[0])
    if number.is_unspecified:
        listening = f"{scheme.removesuffix('out')}in://{host}:{port}"
        raise AddressError(f"{url!r} names any host: to listen, use {listening}; to send, name one.")
    if number.is_multicast or address[0] == "255.255.255.255":
        raise AddressError(f"{url!r} names many hosts: give the vehicle's own address.")
    return family, address


def _peer(text: str, listening: str) -> tuple[str, int | None]:
    """The number of a host, as the socket that listens there sees it, and its port where one is given."""
    host, _, port = text.rpartition(":") if _HOST_PORT.match(text) else (text, "", "")
    family, _ = resolve(listening or ANY_HOST, 0)
    _, address = resolve(host, 0, family)
    return str(address[0]), int(port) if port else None
