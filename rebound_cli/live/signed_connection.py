"""The connection to a vehicle that signs, with the key of --signing-key; a plain one without."""

from argparse import Namespace
from collections.abc import Callable, Mapping

from companion.mavlink.signing import MINUTE, Signing
from companion.shell.clock import Clock
from companion.shell.connections.addresses import Opened, open_connection
from companion.shell.connections.connection import Connection, Way
from companion.shell.signing_files import StampFile, read_key
from rebound_cli.background import Background

# The stamp kept must be less than a minute behind: half of that leaves room for a slow card.
KEEP_EVERY = MINUTE // 2


class SignedConnection:
    """What comes is heard only if it is signed, what goes is signed; no flight waits for the disk with its stamp."""

    def __init__(self, connection: Connection, signing: Signing, stamps: StampFile, clock: Clock) -> None:
        self._connection, self.signing, self._stamps, self._clock = connection, signing, stamps, clock
        self._kept, self.counts = signing.stamp, connection.counts
        self._writer = Background("the signatures' time stamp")

    def receive(self, timeout_s: float) -> bytes:
        opened = self.signing.opened(self._connection.receive(timeout_s), self._clock.now_us())
        if self.signing.stamp - self._kept >= KEEP_EVERY:
            self._keep()
        return opened

    def _keep(self) -> None:
        self._kept = self.signing.stamp
        self._writer.give(self._stamps.keep, self._kept)

    def send(self, frame: bytes) -> None:
        self._connection.send(self.signing.signed(frame, self._clock.now_us()))

    def way(self, frame: bytes) -> Way | None:
        return self._connection.way(self.signing.signed(frame, self._clock.now_us()))

    def news(self) -> str | None:
        return self._connection.news() or self.signing.news() or self._writer.news()

    def close(self) -> None:
        self._connection.close()
        self._keep()
        self._writer.close()


def open_signed(
    options: Namespace, waits: bool = False, shared: Callable[[Opened], Connection] = lambda opened: opened
) -> Connection:
    """To the vehicle at --connect; `shared` makes of it one that others have, too, with signatures of their own.

    Raises ConnectionSetupError, ConfigurationError.
    """
    if options.signing_key is None:
        return shared(open_connection(options.connect, options.peer, waits=waits))
    clock, stamps = Clock(), StampFile(options.signing_key)
    signing = Signing(read_key(options.signing_key), stamps.first(clock.now_us()))
    return SignedConnection(
        shared(open_connection(options.connect, options.peer, signing, waits)), signing, stamps, clock
    )


def refused_packets(connection: Connection | None) -> dict[str, int]:
    """How many, by reason; of a connection without a key, none."""
    return dict(connection.signing.refused) if isinstance(connection, SignedConnection) else {}


def unheard_text(refused: Mapping[str, int]) -> str:
    """What is added where no vehicle was heard: its packets may have been refused, by reason."""
    count = sum(refused.values())
    return f" {count} packets were refused: do both ends sign, with the same key?" if count else ""
