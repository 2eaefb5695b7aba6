"""A guard for programs on MAVSDK (version 4): `from companion.mavsdk import CollisionGuard`. See
docs/tutorials/mavsdk.md.
"""

from companion.guard.config import GuardConfig
from companion.guard.states import State
from companion.shell.mavsdk_guard import CollisionGuard
from companion.shell.mavsdk_link import GuardError

__all__ = ["CollisionGuard", "GuardConfig", "GuardError", "State"]
