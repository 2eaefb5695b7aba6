"""MAVSDK 4's own connection, read and filtered by its C library's interception of messages.

The Python package wraps neither `mavsdk_subscribe_incoming_messages_json` nor its outgoing twin, which the library
exports (cmavsdk/mavsdk.h); they are called here through ctypes, as the package calls all others. Both run on MAVSDK's
I/O thread, the outgoing one on every message just before it is sent.
"""

import ctypes
from collections.abc import Callable
from functools import partial
from typing import Any

from companion.errors import ReboundError
from companion.mavlink.named import named

# Message name, (system, component) it comes from, its fields still as JSON; whether it may go on.
Interceptor = Callable[[str, tuple[int, int], bytes], bool]


class GuardError(ReboundError):
    """The guard cannot be attached, or found nothing that it can guard."""


class MavsdkLink:
    """Of a `Mavsdk` and a `System` of it, synchronous or asyncio. Raises GuardError where MAVSDK 4 is not there."""

    def __init__(self, mavsdk: Any, system: Any) -> None:
        # Only here: MAVSDK is no part of what the rest needs.
        try:
            from mavsdk.plugins.mavlink_direct import mavlink_direct as direct
        except ImportError as error:
            text = "CollisionGuard needs MAVSDK 4 for Python: pip install 'mavsdk>=4.1,<5'."
            raise GuardError(text) from error
        # The asyncio wrappers hold the synchronous objects.
        self._mavsdk = getattr(mavsdk, "_mavsdk", mavsdk)
        system = getattr(system, "_system", system)
        if not hasattr(self._mavsdk, "_handle") or not hasattr(system, "get_system_id"):
            text = "CollisionGuard wants MAVSDK's Mavsdk object and a System of it: CollisionGuard(mavsdk, system)."
            raise GuardError(text)
        self._message_class = direct.MavlinkMessage
        self._callback_class = ctypes.CFUNCTYPE(ctypes.c_int, direct.MavlinkMessageCStruct, ctypes.c_void_p)
        self._direct = direct.MavlinkDirect(system)
        self.system_id = int(system.get_system_id())
        self._handles: list[Any] = []

    def intercept(self, incoming: Interceptor, outgoing: Interceptor) -> None:
        """From now on; both are called on MAVSDK's I/O thread and must not call `release`."""
        for direction, interceptor in (("incoming", incoming), ("outgoing", outgoing)):
            subscribe = self._function(f"mavsdk_subscribe_{direction}_messages_json", ctypes.c_void_p)
            unsubscribe = self._function(f"mavsdk_unsubscribe_{direction}_messages_json", None)
            subscribe.argtypes = [ctypes.c_void_p, self._callback_class, ctypes.c_void_p]
            unsubscribe.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
            callback = self._callback_class(partial(_ask, interceptor))
            handle = subscribe(self._mavsdk._handle, callback, None)
            # Mavsdk.destroy() releases what it finds here, so that either end may come first.
            self._mavsdk._subscriptions[handle] = (callback, unsubscribe)
            self._handles.append(handle)

    def _function(self, name: str, result: Any) -> Any:
        try:
            function = getattr(self._mavsdk._lib, name)
        except AttributeError:
            raise GuardError(f"This MAVSDK's library has no {name}: install mavsdk 4.1 or later.") from None
        function.restype = result
        return function

    def send(self, packet: bytes) -> None:
        """As the program itself would; from any thread. Raises RuntimeError once MAVSDK is gone."""
        name, fields_json = named(packet)
        self._direct.send_message(self._message_class(name, fields_json=fields_json))

    def release(self) -> None:
        """Not to be called while holding what an interceptor waits for."""
        for handle in self._handles:
            self._mavsdk._unsubscribe(handle)
        self._handles.clear()
        self._direct.destroy()


def _ask(interceptor: Interceptor, message: Any, _: Any) -> int:
    source = (message.system_id, message.component_id)
    return int(interceptor(message.message_name.decode(), source, message.fields_json))
